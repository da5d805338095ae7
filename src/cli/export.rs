//! `ramphold export`: sessions in the formats of other tools.

use std::path::PathBuf;

use ramphold::export::{self, Participant, Rows};

use super::fit::session_folders;
use super::{Console, Failure, Verb};

/// Write sessions as a BIDS dataset or as one Parquet table.
#[derive(Debug, clap::Args)]
#[command(
    group(clap::ArgGroup::new("format").required(true).args(["bids", "parquet"])),
    after_help = "Examples:\n  ramphold export sessions --bids study\n  \
                  ramphold export sessions/S01 --bids study --participant 01\n  \
                  ramphold export sessions --parquet samples.parquet\n  \
                  ramphold export sessions --parquet trials.parquet --trials"
)]
pub struct Export {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
    /// Make a BIDS dataset in this folder, which must be new or empty.
    #[arg(long, value_name = "DIR")]
    bids: Option<PathBuf>,
    /// Name of the person in BIDS file names, letters and digits only; the session's subject if not given.
    #[arg(long, value_name = "LABEL", requires = "bids")]
    participant: Option<String>,
    /// Write a table to this file, which must be new: one row a sample.
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// One row a trial, with its fit, instead.
    #[arg(long, requires = "parquet")]
    trials: bool,
}

impl Verb for Export {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let folders = session_folders(&self.sessions)?;
        if let Some(file) = &self.parquet {
            let rows = if self.trials { Rows::Trials } else { Rows::Samples };
            export::write_parquet(&folders, file, rows)?;
            console.message(format_args!("{} sessions in {}", folders.len(), file.display()));
        }
        if let Some(target) = &self.bids {
            if self.participant.is_some() && folders.len() > 1 {
                return Err(Failure::Usage(format!(
                    "--participant names the person of one session, and there are {}",
                    folders.len()
                )));
            }
            let participant =
                |folder: &PathBuf| Participant { folder: folder.clone(), label: self.participant.clone() };
            let participants: Vec<Participant> = folders.iter().map(participant).collect();
            export::write_bids(&participants, target)?;
            console.message(format_args!("{} sessions in {}", folders.len(), target.display()));
        }
        Ok(())
    }
}
