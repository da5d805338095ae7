//! `ramphold resume`: resumes a session.

use std::path::PathBuf;

use crate::app::{Console, ConsoleOptions, Failure, Pace, ResumeRequest, parse_seed};

use super::verb::Verb;

/// Resume a session that was stopped, killed or ended by a fault.
#[derive(Debug, clap::Args)]
#[command(
    after_help = "Examples:\n  ramphold resume sessions/quick-V00-7\n  ramphold resume sessions/quick-V00-7 --yes\n\n\
                        The trial that was under way is kept with status aborted and is run again later."
)]
pub struct ResumeArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    /// Confirm that the motor may move, instead of being asked. It does not say where the handle is.
    #[arg(long)]
    yes: bool,
    /// The handle of the motor stands at the start position: take its present place for it. Needed only for a motor that takes
    /// the present place for its start position and cannot show that it still has that of the session.
    #[arg(long)]
    home_here: bool,
    /// Seed that was given to `run --hide`, if the session has a hidden effect.
    #[arg(long, value_name = "SEED", allow_negative_numbers = true, value_parser = parse_seed)]
    hide: Option<u64>,
    /// Run in real time [default: as fast as possible].
    #[arg(long, conflicts_with = "speed")]
    real_time: bool,
    /// Run at this multiple of real time; for a virtual wrist.
    #[arg(long, value_name = "FACTOR")]
    speed: Option<f64>,
    /// The file of liblsl, for the streams of the rig file [default: where the operating system finds it].
    #[arg(long, value_name = "FILE")]
    lsl_library: Option<PathBuf>,
    #[command(flatten)]
    console: ConsoleOptions,
}

impl Verb for ResumeArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        ResumeRequest {
            session: &self.session,
            is_confirmed: self.yes,
            home_here: self.home_here,
            hide: self.hide,
            pace: Pace::new(self.real_time, self.speed)?,
            lsl_library: self.lsl_library.as_deref(),
            console: &self.console,
        }
        .run(console)
    }
}
