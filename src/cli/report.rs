//! `ramphold report`: figures and tables of sessions and studies for a reader.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::app::{
    Console, Failure, ResultsFolder, check_has_none, check_out, folders_in, write_report_to,
    write_study_report,
};
use crate::dataset::{self, session_folders};
use crate::files::{EntryKind, Folder};
use crate::report::ReportError;
use crate::study::is_study;

use super::verb::Verb;

/// What a report consists of.
const REPORT_FILES: [&str; 2] = ["report.html", "figures"];

/// Write the report of sessions or studies: one HTML page that needs no network, and its figures as SVG.
///
/// The report of a session begins with its verdict: whether the model is adequate, what is wrong, and how much that changes k_srs and
/// x_e. It shows the session, its fit (`ramphold fit`) and its diagnosis (`ramphold diagnose`), and lists what is
/// missing. Results that were made from other inputs, or with other settings than those beside them, are named and not shown. The
/// report is written to results/report.html in the session's folder; its path is printed. The report of a study (a folder that
/// `ramphold cohort` wrote) shows means with the curves of single subjects, the effects with their sizes, and who was left out and why; it
/// is written to report.html in the study's folder.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold report sessions/S01\n  \
                        ramphold report sessions/S01 --beside window-300ms --out compared\n  \
                        ramphold report eight")]
pub struct ReportArgs {
    /// Session folders, folders of session folders, or folders of studies.
    #[arg(required = true, value_name = "SESSION|STUDY")]
    sessions: Vec<PathBuf>,
    /// Lay a second fit beside the first: a folder inside results/, or a folder that `fit --out` wrote.
    #[arg(long, value_name = "DIR")]
    beside: Option<PathBuf>,
    /// Folder for the report [default: results/ in the session's folder, or the study's folder]. With several, a folder in it for each.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for ReportArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        if let Some(out) = &self.out {
            check_out("--out", out)?;
        }
        let (studies, sessions): (Vec<PathBuf>, Vec<PathBuf>) =
            self.sessions.iter().cloned().partition(|folder| is_study(folder));
        if self.beside.is_some() && !studies.is_empty() {
            let study = studies[0].display();
            return Err(Failure::Usage(format!(
                "--beside: {study} is a study, which has no second fit; give the folder of a session"
            )));
        }
        let sessions = if sessions.is_empty() { sessions } else { session_folders(&sessions)? };
        let mut outs = self.out_folders(&[&studies[..], &sessions].concat())?.into_iter();
        for study in &studies {
            let out = outs.next().flatten().unwrap_or_else(|| study.clone());
            let page = write_study_report(study, &ResultsFolder::Given(out).open()?)?;
            writeln!(console.results(), "{}", page.display())?;
        }
        for session in &sessions {
            let results = ResultsFolder::OfSession(session.clone()).open()?;
            let beside = self.beside.as_deref().map(|beside| second_results(&results, beside)).transpose()?;
            let out = match outs.next().flatten() {
                None => results.clone(),
                Some(out) => ResultsFolder::Given(out).open()?,
            };
            let read = dataset::load(session)?;
            let page = write_report_to(session, read, &results, beside.as_ref(), &out, console)?;
            writeln!(console.results(), "{}", page.display())?;
        }
        Ok(())
    }
}

impl ReportArgs {
    /// The folder in `--out` for the report of each of `folders`, where nothing is replaced; none without `--out`.
    fn out_folders(&self, folders: &[PathBuf]) -> Result<Vec<Option<PathBuf>>, Failure> {
        let Some(out) = &self.out else { return Ok(vec![None; folders.len()]) };
        let outs = folders_in(out, folders)?;
        outs.iter().try_for_each(|own| check_has_none("--out", own, &REPORT_FILES))?;
        Ok(outs.into_iter().map(Some).collect())
    }
}

/// The folder `beside`: one inside the results of the session, or one that the operator named.
fn second_results(results: &Folder, beside: &Path) -> Result<Folder, Failure> {
    let opened = match results.kind(beside) {
        Ok(Some(EntryKind::Folder)) => results.folder(beside),
        _ => Folder::open(beside),
    };
    opened.map_err(|source| match source.kind() {
        ErrorKind::NotFound => ReportError::NoFit { folder: beside.to_owned() }.into(),
        _ => Failure::Read { file: beside.display().to_string(), source },
    })
}
