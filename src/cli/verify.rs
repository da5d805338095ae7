//! `ramphold verify`: whether a session is still what it was when it ended.

use std::io::Write;
use std::path::PathBuf;

use ramphold::dataset::Manifest;

use super::{Console, Failure, Verb};

/// Name every file of a session that was changed, is missing or was added since the session ended.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold verify sessions/quick-V00-7")]
pub struct Verify {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
}

impl Verb for Verify {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let manifest = Manifest::read(&self.session)?;
        let changes = manifest.changes(&self.session)?;
        let mut out = console.results();
        for change in &changes {
            writeln!(out, "{:8} {}", change.word(), change.file())?;
        }
        if !changes.is_empty() {
            return Err(Failure::NotAsItWas { session: self.session, files: changes.len() });
        }
        writeln!(
            out,
            "{} files as they were; subject {}, seed {}, {}, commit {}, platform {}",
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
