//! `ramphold watch`: plays a recorded session in the pages of the console.

use std::path::PathBuf;
use std::sync::atomic::Ordering;
use std::time::Duration;

use crate::app::{Console, Failure, PageOptions, stop_on_signals};
use crate::console::player::Playback;

use super::verb::Verb;

/// Time between two checks for Ctrl-C.
const STOP_POLL: Duration = Duration::from_millis(100);

/// Play a recorded session in the operator's and the subject's page, until Ctrl-C.
///
/// The operator's page has controls for speed and time. The addresses of both pages are printed.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  ramphold watch sessions/quick-V00-7")]
pub struct WatchArgs {
    /// The session's folder.
    #[arg(value_name = "SESSION")]
    session: PathBuf,
    #[command(flatten)]
    pages: PageOptions,
}

impl Verb for WatchArgs {
    fn run(self, console: &Console) -> Result<(), Failure> {
        let address = self.pages.address()?;
        let stop = stop_on_signals()?;
        let playback = Playback::open(&self.session, &address, self.pages.wrist())?;
        self.pages.announce(&playback.pages(), console);
        while !stop.load(Ordering::Relaxed) {
            std::thread::sleep(STOP_POLL);
        }
        Ok(())
    }
}
