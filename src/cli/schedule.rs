//! `ramphold schedule`: the order of the trials.

use std::path::PathBuf;

use ramphold::protocol::ValidProtocol;
use ramphold::schedule;

use super::{Console, Failure, Verb};

/// Print the order of the trials, as schedule.csv has it.
///
/// The same seed gives the same order on every platform and in every later version.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold schedule protocols/de-vlugt-2011.json --seed 1")]
pub struct Schedule {
    /// The protocol file.
    protocol: PathBuf,
    /// The seed of the order.
    #[arg(long, value_name = "N")]
    seed: u64,
    /// The subject's number, from 1; an order of kind "williams" takes its row from it.
    #[arg(long, value_name = "K")]
    subject_number: Option<u32>,
}

impl Verb for Schedule {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let protocol = ValidProtocol::read(&self.protocol)?;
        let order = schedule::draw(&protocol, self.seed, self.subject_number)?;
        Ok(schedule::write_csv(&order, console.results())?)
    }
}
