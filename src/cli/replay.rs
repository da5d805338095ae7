//! `ramphold replay`: repeats a recorded session in the state machine.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure};
use crate::dataset;

use super::verb::Verb;

/// Replay a recorded session through the state machine and compare each of its decisions with the record.
///
/// Prints the number of samples and events that agree, or the first difference. Exit code 1 if there is a difference.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold replay sessions/quick-V00-7")]
pub struct ReplayArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
}

impl Verb for ReplayArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let replay = dataset::replay(&self.session)?;
        let mut out = console.results();
        for file in &replay.changed_files {
            writeln!(out, "{file} since the session, as the journal shows")?;
        }
        for garbage in &replay.garbage {
            writeln!(out, "{garbage}")?;
        }
        let Some(difference) = &replay.difference else {
            writeln!(
                out,
                "replayed {} samples, {} events, {} starts: no difference",
                replay.steps, replay.events, replay.starts
            )?;
            return if replay.is_sound() { Ok(()) } else { Err(Failure::Differs { session: self.session }) };
        };
        writeln!(out, "first difference at {difference}")?;
        writeln!(out, "{} events before it agree with the record", replay.events)?;
        if replay.is_from_the_future() {
            writeln!(
                out,
                "recorded by {} under rules {}, which are newer than this program",
                replay.program, replay.rules
            )?;
        }
        for change in replay.changed_rules() {
            writeln!(
                out,
                "recorded by {} under rules {}; since rules {}: {}",
                replay.program, replay.rules, change.rules, change.text
            )?;
        }
        Err(Failure::Differs { session: self.session })
    }
}
