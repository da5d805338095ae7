//! `ramphold report`: pictures and tables of sessions for a person.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure, session_folders, write_report_to};

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
        let sessions = session_folders(&self.sessions)?;
        for session in &sessions {
            let results = session.join("results");
            let out = match (&self.out, session.file_name()) {
                (None, _) => results.clone(),
                (Some(out), Some(name)) if sessions.len() > 1 => out.join(name),
                (Some(out), _) => out.clone(),
            };
            let named = |folder: &PathBuf| match results.join(folder) {
                inside if inside.is_dir() => inside,
                _ => folder.clone(),
            };
            let beside = self.beside.as_ref().map(named);
            let page = write_report_to(session, &results, beside.as_deref(), &out, console)?;
            writeln!(console.results(), "{}", page.display())?;
        }
        Ok(())
    }
}
