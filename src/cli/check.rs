//! `ramphold check`: everything that is wrong with a protocol, at once.

use std::io::Write;
use std::path::PathBuf;

use ramphold::protocol::{Order, ValidProtocol};
use ramphold::schedule;

use super::{Console, Failure, Verb};

/// Check a protocol: say everything that is wrong with it, or how long it takes.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold check protocols/de-vlugt-2011.json")]
pub struct Check {
    /// The protocol file.
    protocol: PathBuf,
}

impl Verb for Check {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        // Whether a constrained order exists shows only in the drawing; any seed and any subject will do.
        schedule::draw(&protocol, 0, Some(1))?;
        let mut out = console.results();
        writeln!(out, "{}: {}, can be run", self.protocol.display(), protocol.name)?;
        writeln!(out, "  trials: {}", trials(&protocol))?;
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
        count => format!("; before them {count} to get familiar"),
    };
    format!(
        "{} ({} velocities x {} torques x {} repetitions, {order}){before}",
        protocol.trial_count(),
        protocol.velocities_rad_s.len(),
        protocol.torques_nm.len(),
        protocol.repetitions
    )
}

fn minutes(seconds: f64) -> String {
    let seconds = seconds.round() as u64;
    format!("{} min {:02} s", seconds / 60, seconds % 60)
}
