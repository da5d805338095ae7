//! `ramphold report`: pictures and tables of sessions for a person.

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use crate::app::{Console, Failure, ResultsFolder, check_out, write_report_to};
use crate::dataset::session_folders;
use crate::files::{EntryKind, Folder};
use crate::report::ReportError;

use super::verb::Verb;

/// Write the report of sessions: one HTML page that needs no network, and its figures as SVG.
///
/// The report shows the session, its fit (`ramphold fit`) and its diagnosis (`ramphold diagnose`), and lists what is
/// missing. Results that were made from other inputs, or with other settings than those beside them, are named and not shown. The
/// report is written to results/report.html in the session's folder; its path is printed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold report sessions/S01\n  \
                        ramphold report sessions/S01 --beside window-300ms --out compared")]
pub struct ReportArgs {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
    /// Lay a second fit beside the first: a folder inside results/, or a folder that `fit --out` wrote.
    #[arg(long, value_name = "DIR")]
    beside: Option<PathBuf>,
    /// Folder for the report [default: results/ in the session's folder]. With several sessions, a folder in it for each.
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

impl Verb for ReportArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        if let Some(out) = &self.out {
            check_out("--out", out)?;
        }
        let sessions = session_folders(&self.sessions)?;
        for session in &sessions {
            let results = ResultsFolder::OfSession(session.clone()).open()?;
            let beside = self.beside.as_deref().map(|beside| second_results(&results, beside)).transpose()?;
            let out = match (&self.out, session.file_name()) {
                (None, _) => results.clone(),
                (Some(out), Some(name)) if sessions.len() > 1 => {
                    ResultsFolder::Given(out.join(name)).open()?
                }
                (Some(out), _) => ResultsFolder::Given(out.clone()).open()?,
            };
            let page = write_report_to(session, &results, beside.as_ref(), &out, console)?;
            writeln!(console.results(), "{}", page.display())?;
        }
        Ok(())
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
