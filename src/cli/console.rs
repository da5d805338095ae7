//! `ramphold console`: the console of a laboratory, session after session.

use std::path::PathBuf;

use crate::app::{Console, Failure, LaboratoryConsole, Pace, PageOptions};

use super::verb::Verb;

/// Serve the pages of a laboratory, in which sessions are chosen, checked, run and ended, until Ctrl-C.
///
/// The operator's page offers the subjects, protocols, rigs and calibrations of the folder that ramphold new made, checks what is
/// chosen, and begins a session. The session is that of ramphold run --console: it waits, disarmed, for the operator to start it, and a
/// motor asks before it is armed. The addresses of both pages stay the same from session to session.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold console wrist-lab\n  ramphold console --console-port 8800 --operator \"A. Berg\""
)]
pub struct ConsoleArgs {
    /// The laboratory's folder.
    #[arg(value_name = "LABORATORY", default_value = ".")]
    laboratory: PathBuf,
    /// Speed of sessions on the virtual wrist, as a multiple of real time. A motor always runs in real time.
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0)]
    speed: f64,
    /// Who runs the sessions; kept in session.json.
    #[arg(long, value_name = "NAME")]
    operator: Option<String>,
    /// Pause after the trial when no operator's page has been open for this time, s; 0 never pauses.
    #[arg(long, value_name = "S", default_value_t = 10.0)]
    operator_timeout: f64,
    /// Publish the sessions over Lab Streaming Layer: samples, and a marker for each transition. Needs real time.
    #[arg(long, conflicts_with = "speed")]
    lsl: bool,
    /// The file of liblsl, for --lsl and for the streams of a rig file [default: where the operating system finds it].
    #[arg(long, value_name = "FILE")]
    lsl_library: Option<PathBuf>,
    #[command(flatten)]
    pages: PageOptions,
}

impl Verb for ConsoleArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        LaboratoryConsole {
            folder: self.laboratory,
            pages: self.pages,
            operator_timeout_s: self.operator_timeout,
            pace: Pace::new(false, Some(self.speed))?,
            operator: self.operator,
            lsl: self.lsl,
            lsl_library: self.lsl_library,
        }
        .serve(console)
    }
}
