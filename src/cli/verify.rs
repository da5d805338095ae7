//! `ramphold verify`: compares a session with its manifest.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure};
use crate::dataset::{Amendments, Manifest};

use super::verb::Verb;

/// Compare the files of a session with its manifest; list each file that was changed, removed or added.
///
/// The manifest holds the SHA-256 of each file at the end of the session. Exit code 1 if a file differs.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold verify sessions/quick-V00-7")]
pub struct VerifyArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
}

impl Verb for VerifyArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let manifest = Manifest::read(&self.session)?;
        let changes = manifest.changes(&self.session)?;
        let mut out = console.results();
        for change in &changes {
            writeln!(out, "{:8} {}", change.word(), change.file())?;
        }
        for amendment in &Amendments::read(&self.session)?.amendments {
            writeln!(
                out,
                "trial {} {} by {}, {}: {}",
                amendment.trial,
                amendment.status.name(),
                amendment.by,
                amendment.at_utc,
                amendment.because
            )?;
        }
        if !changes.is_empty() {
            return Err(Failure::NotAsItWas { session: self.session, files: changes.len() });
        }
        writeln!(
            out,
            "{} files unchanged; subject {}, seed {}, {}, commit {}, platform {}",
            manifest.files.len(),
            manifest.subject,
            manifest.seed,
            manifest.program,
            manifest.git_commit.as_deref().unwrap_or("not known"),
            manifest.platform
        )?;
        Ok(())
    }
}
