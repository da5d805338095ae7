//! `ramphold report`: pictures and tables of sessions for a person.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure, ResultsFolder, write_report};

use crate::dataset::session_folders;

use super::verb::Verb;

/// Write the report of sessions: one HTML page that needs no network, and its figures as SVG.
///
/// The report shows the session, its fit (`ramphold fit`) and its diagnosis (`ramphold diagnose`), and lists what is
/// missing. It is written to results/report.html in the session's folder; its path is printed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold report sessions/S01")]
pub struct ReportArgs {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
}

impl Verb for ReportArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        for session in session_folders(&self.sessions)? {
            let page = write_report(&session, &ResultsFolder::OfSession(session.clone()).open()?, console)?;
            writeln!(console.results(), "{}", page.display())?;
        }
        Ok(())
    }
}
