//! `ramphold check`: checks a protocol file.

use std::io::Write;
use std::path::PathBuf;

use crate::app::{Console, Failure, rig_trials_text};
use crate::protocol::{Order, ValidProtocol, minutes};
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
        writeln!(out, "  trials: {}", trials(&protocol))?;
        if let Some(rig_trials) = rig_trials_text(&protocol) {
            writeln!(out, "  rig trials: {rig_trials}")?;
        }
        let duration = protocol.duration();
        writeln!(
            out,
            "  expected duration: {} ({} if every gate opens at once, {} if each takes its timeout)",
            minutes(duration.expected_s),
            minutes(duration.shortest_s),
            minutes(duration.longest_s)
        )?;
        Ok(())
    }
}

fn trials(protocol: &ValidProtocol) -> String {
    let order = match &protocol.order {
        Order::Shuffled => "shuffled".to_owned(),
        Order::Blocked => "blocked".to_owned(),
        Order::Constrained { max_run } => format!("constrained to runs of at most {max_run}"),
        Order::Williams => "Williams square".to_owned(),
        Order::Fixed { .. } => "fixed".to_owned(),
    };
    let before = match protocol.before.familiarisation_trials {
        0 => String::new(),
        count => format!("; before them {count} familiarisation trials"),
    };
    format!(
        "{} ({} velocities x {} torques x {} repetitions, {order}){before}",
        protocol.trial_count(),
        protocol.velocities_rad_s.len(),
        protocol.torques_nm.len(),
        protocol.repetitions
    )
}
