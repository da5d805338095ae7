//! `ramphold replay`: goes through a recorded session again.

use std::io::Write;
use std::path::PathBuf;

use ramphold::dataset;

use super::{Console, Failure, Verb};

/// Feed a session's records to the state machine again and compare everything it decides.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold replay sessions/quick-V00-7")]
pub struct Replay {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
}

impl Verb for Replay {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let replay = dataset::replay(&self.session)?;
        let mut out = console.results();
        let Some(difference) = &replay.difference else {
            writeln!(
                out,
                "replayed {} samples, {} events, {} starts: no difference",
                replay.steps, replay.events, replay.starts
            )?;
            return Ok(());
        };
        writeln!(out, "first difference at {difference}")?;
        writeln!(out, "{} events before it came out as recorded", replay.events)?;
        if replay.is_from_the_future() {
            writeln!(
                out,
                "recorded by {} under rules {}, which this program does not know yet",
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
