//! `ramphold export`: sessions in the formats of other tools.

use std::path::PathBuf;

use crate::app::{Console, Failure, check_out, tell_foreign_results};
use crate::dataset::session_folders;
use crate::export::{self, Participant, Rows};

use super::verb::Verb;

/// Export sessions as a BIDS dataset, as one Parquet table, as one .mat file, as an XDF file or as an NWB file.
///
/// One of --bids, --parquet, --mat, --xdf and --nwb is required. The sessions are not changed.
#[derive(Debug, clap::Args)]
#[command(
    group(clap::ArgGroup::new("format").required(true).args(["bids", "parquet", "mat", "xdf", "nwb"])),
    after_help = "Examples:\n  ramphold export sessions --bids study\n  \
                  ramphold export sessions/S01 --bids study --participant 01\n  \
                  ramphold export sessions --parquet samples.parquet\n  \
                  ramphold export sessions --parquet trials.parquet --trials\n  \
                  ramphold export sessions --mat sessions.mat\n  \
                  ramphold export sessions/S01 --xdf S01.xdf\n  \
                  ramphold export sessions/S01 --nwb S01.nwb"
)]
pub struct ExportArgs {
    /// Session folders, or folders of session folders.
    #[arg(required = true, value_name = "SESSION")]
    sessions: Vec<PathBuf>,
    /// Write a BIDS dataset into this folder, which must be new or empty.
    #[arg(long, value_name = "DIR")]
    bids: Option<PathBuf>,
    /// Label of the subject in BIDS file names, letters and digits only [default: the session's subject].
    #[arg(long, value_name = "LABEL", requires = "bids")]
    participant: Option<String>,
    /// Write a Parquet table with one row per sample to this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    parquet: Option<PathBuf>,
    /// Write one row per trial, with its fit, instead of one per sample.
    #[arg(long, requires = "parquet")]
    trials: bool,
    /// Write a .mat file, which MATLAB and Octave open, to this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    mat: Option<PathBuf>,
    /// Write one session as XDF, the format of LabRecorder, to this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    xdf: Option<PathBuf>,
    /// Write one session as NWB (Neurodata Without Borders), which pynwb and MatNWB open, to this file, which must not exist yet.
    #[arg(long, value_name = "FILE")]
    nwb: Option<PathBuf>,
}

/// The only session of a file that holds one.
fn only_session<'a>(option: &str, folders: &'a [PathBuf]) -> Result<&'a PathBuf, Failure> {
    match folders {
        [folder] => Ok(folder),
        several => Err(Failure::Usage(format!(
            "{option} holds one session, but {} are given; export each to a file of its own",
            several.len()
        ))),
    }
}

impl Verb for ExportArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let folders = session_folders(&self.sessions)?;
        for folder in &folders {
            tell_foreign_results(folder, console)?;
        }
        if let Some(file) = &self.parquet {
            check_out("--parquet", file)?;
            let rows = if self.trials { Rows::Trials } else { Rows::Samples };
            export::write_parquet(&folders, file, rows)?;
            console.message(format_args!("{} sessions in {}", folders.len(), file.display()));
        }
        if let Some(file) = &self.mat {
            check_out("--mat", file)?;
            export::write_mat(&folders, file)?;
            console.message(format_args!("{} sessions in {}", folders.len(), file.display()));
        }
        if let Some(file) = &self.xdf {
            check_out("--xdf", file)?;
            let folder = only_session("--xdf", &folders)?;
            export::write_xdf(folder, file)?;
            console.message(format_args!("{} in {}", folder.display(), file.display()));
        }
        if let Some(file) = &self.nwb {
            check_out("--nwb", file)?;
            let folder = only_session("--nwb", &folders)?;
            export::write_nwb(folder, file)?;
            console.message(format_args!("{} in {}", folder.display(), file.display()));
        }
        if let Some(target) = &self.bids {
            check_out("--bids", target)?;
            if self.participant.is_some() && folders.len() > 1 {
                return Err(Failure::Usage(format!(
                    "--participant labels the subject of one session, but {} sessions are given",
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
