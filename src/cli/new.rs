//! `ramphold new`: the folder of a laboratory.

use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::atomic::AtomicBool;

use crate::app::{Console, Failure, Laboratory, ask, check_out};

use super::verb::Verb;

/// Make the folder of a laboratory: protocol, rig, subjects, and a place for calibrations and sessions.
///
/// What no option says is asked at the terminal; without a terminal, or with --yes, the defaults in brackets are taken.
#[derive(Debug, clap::Args)]
#[command(after_help = "Examples:\n  ramphold new wrist-lab\n  \
                        ramphold new wrist-lab --protocol paper --rig virtual --emg no --subjects S01,S02 --yes")]
pub struct NewArgs {
    /// The folder, which must be new or empty.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The protocol: paper (de Vlugt et al. 2011), quick (a first look), or a file [quick].
    #[arg(long, value_name = "NAME|FILE")]
    protocol: Option<String>,
    /// The rig: virtual, or a rig file [virtual].
    #[arg(long, value_name = "virtual|FILE")]
    rig: Option<String>,
    /// Whether a virtual rig measures EMG; the file of another rig says it itself [yes].
    #[arg(long, value_name = "WHETHER")]
    emg: Option<YesNo>,
    /// Identifiers of the subjects, with commas between them [S01].
    #[arg(long, value_name = "IDS", value_delimiter = ',')]
    subjects: Vec<String>,
    /// Ask nothing: take the defaults.
    #[arg(long)]
    yes: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum YesNo {
    Yes,
    No,
}

impl Verb for NewArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        check_out("DIR", &self.folder)?;
        let asks = !self.yes && io::stdin().is_terminal();
        let question = |given: Option<String>, question: &str, default: &str| match given {
            Some(given) => given,
            None if asks => {
                let answer = ask(&format!("{question} [{default}]: "), &AtomicBool::new(false));
                answer.filter(|answer| !answer.is_empty()).unwrap_or_else(|| default.to_owned())
            }
            None => default.to_owned(),
        };
        let protocol = question(self.protocol, "Protocol: paper, quick, or a file", "quick");
        let rig = question(self.rig, "Rig: virtual, or the file of a motor", "virtual");
        let emg = match self.emg {
            Some(emg) => emg == YesNo::Yes,
            None if rig == "virtual" => {
                match question(None, "Does the rig measure EMG, yes or no", "yes").as_str() {
                    "yes" => true,
                    "no" => false,
                    other => return Err(Failure::Usage(format!("EMG: {other:?}; expected yes or no"))),
                }
            }
            None => true,
        };
        let subjects = match self.subjects.is_empty() {
            false => self.subjects,
            true => question(None, "Subjects, with commas between them", "S01")
                .split(',')
                .map(|id| id.trim().to_owned())
                .collect(),
        };
        Laboratory::new(&protocol, &rig, emg, subjects)?.write(&self.folder)?;
        let shown = self.folder.display();
        console.message(format_args!("{shown}/README.md says what is there and how to begin"));
        writeln!(console.results(), "{shown}")?;
        Ok(())
    }
}
