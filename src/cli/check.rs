//! `ramphold check`: checks a protocol file.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure, duration_text, rig_trials_text, trials_text};
use crate::protocol::ValidProtocol;
use crate::schedule;

use super::verb::Verb;

/// Check a protocol file: print every mistake in it, or the number of trials and the expected duration.
///
/// Each mistake is printed with its line, its field, the expected value and what to do. Nothing is run and nothing is
/// written. Exit code 2 if the protocol cannot be run.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold check protocols/de-vlugt-2011.json")]
pub struct CheckArgs {
    /// The protocol file.
    protocol: PathBuf,
}

impl Verb for CheckArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        // Only drawing shows whether a constrained order exists; any seed and any subject will do.
        schedule::draw(&protocol, 0, Some(1))?;
        let mut out = console.results();
        writeln!(out, "{}: {}, can be run", self.protocol.display(), protocol.name)?;
        writeln!(out, "  trials: {}", trials_text(&protocol))?;
        if let Some(rig_trials) = rig_trials_text(&protocol) {
            writeln!(out, "  rig trials: {rig_trials}")?;
        }
        writeln!(out, "  expected duration: {}", duration_text(&protocol))?;
        Ok(())
    }
}
