//! `ramphold report`: pictures and tables of sessions for a person.

use std::io::Write;
use std::path::{Path, PathBuf};

use ramphold::dataset::Disk;
use ramphold::report;

use super::fit::session_folders;
use super::{Console, Failure, Verb};

/// Write a session's report: one page that opens anywhere, and its figures.
///
/// It shows what there is: the session, its fit (`ramphold fit`) and its diagnosis (`ramphold diagnose`), and says what is
/// missing.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold report sessions/S01")]
pub struct Report {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
}

impl Verb for Report {
    fn run(self, console: &Console) -> Result<(), Failure> {
        for session in session_folders(&self.sessions)? {
            let page = write_report(&session, &session.join("results"), console)?;
            writeln!(console.results(), "{}", page.display())?;
        }
        Ok(())
    }
}

/// Writes the report beside the results and says what it lacks.
pub fn write_report(session: &Path, results: &Path, console: &Console) -> Result<PathBuf, Failure> {
    let written = report::write(session, results, &Disk::default())?;
    for missing in &written.missing {
        console.message(missing);
    }
    Ok(written.page)
}
