//! `ramphold schedule`: the order of the trials.

use std::path::PathBuf;

use crate::app::{Console, Failure, parse_seed, rig_trials_text};
use crate::protocol::ValidProtocol;
use crate::schedule;

use super::verb::Verb;

/// Print the order of the trials of a protocol, in the form of schedule.csv.
///
/// The same seed gives the same order on every platform and in every later version.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold schedule protocols/de-vlugt-2011.json --seed 1")]
pub struct ScheduleArgs {
    /// The protocol file.
    protocol: PathBuf,
    /// Seed of the order.
    #[arg(long, value_name = "N", allow_negative_numbers = true, value_parser = parse_seed)]
    seed: u64,
    /// The subject's number, from 1; needed for an order of kind "williams", whose row it selects.
    #[arg(long, value_name = "K")]
    subject_number: Option<u32>,
}

impl Verb for ScheduleArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        let order = schedule::draw(&protocol, self.seed, self.subject_number)?;
        if let Some(rig_trials) = rig_trials_text(&protocol) {
            console.message(format_args!("before these trials come rig trials: {rig_trials}"));
        }
        Ok(schedule::write_csv(&order, console.results())?)
    }
}
