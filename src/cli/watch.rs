//! `ramphold watch`: a recorded session in the pages of the console.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use ramphold::console::player::Playback;

use super::live::{PageOptions, stop_on_signals};
use super::{Console, Failure, Verb};

/// How often it is looked whether Ctrl-C was pressed.
const IDLE: Duration = Duration::from_millis(100);

/// Play a recorded session in the operator's and the person's page, with speed and a time slider, until Ctrl-C.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold watch sessions/quick-V00-7")]
pub struct Watch {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    #[command(flatten)]
    pages: PageOptions,
}

impl Verb for Watch {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let address = self.pages.address()?;
        let stop = stop_on_signals()?;
        let watching = Playback::open(&self.session, &address, self.pages.wrist())?;
        let pages = watching.pages();
        self.pages.announce(&pages.operator, &pages.person, console);
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(IDLE);
        }
        Ok(())
    }
}
