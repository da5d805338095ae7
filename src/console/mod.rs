//! The console: what the operator and the person see while a session runs, and how the operator is heard.
//!
//! The loop lets a copy of each step out through a ring ([`Tapped`]) and hears words through another ([`CommandReceiver`]); it
//! never waits for what is behind them. The [`ViewModel`] makes pictures of the steps; pages in a browser ([`web`]) and the
//! [`terminal`] draw the latest. A recorded session comes the same way ([`player`]).

mod commands;
mod display_latency;
mod error;
mod fitter;
mod history;
mod live;
pub mod player;
mod snapshot;
mod step_feed;
mod strip_chart;
#[cfg(feature = "terminal")]
pub mod terminal;
#[cfg(not(feature = "terminal"))]
#[path = "without_terminal.rs"]
pub mod terminal;
mod view_model;
pub mod web;
mod welcome;

pub use commands::{CommandReceiver, CommandSender, OperatorNotice};
pub use display_latency::{DisplayLatencies, DisplayLatency};
pub use error::ConsoleError;
pub use fitter::{Fitter, TrialFit, TrialFitContext, TrialFitOutcome};
pub use live::{ConsoleSetup, Live, PageAddresses};
pub use snapshot::{CurrentTrial, Instruction, PlaybackState, Snapshot, SubjectView};
pub use step_feed::{SampleCounter, Tapped, TimedStep};
pub use strip_chart::{BIN_S, Bin};
pub use view_model::{ViewModel, Views};
pub use welcome::SessionInfo;

/// What pages say to the program. None of it can come from the person's page.
pub trait Controls: Send + Sync {
    /// Something was asked for at a desk.
    fn hear(&self, request: Request, desk: crate::dataset::ActionOrigin);

    /// An operator came to a desk.
    fn joined(&self, _desk: crate::dataset::ActionOrigin) {}

    /// An operator's desk is empty.
    fn left(&self, _desk: crate::dataset::ActionOrigin) {}
}

/// What an operator can ask for.
#[derive(Debug, Clone, PartialEq, serde::Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// A word for the session.
    Word {
        /// Which.
        word: crate::session::Event,
        /// The operator was asked and said yes; needed for what cannot be taken back.
        #[serde(default)]
        sure: bool,
    },
    /// A pause when the trial under way is over.
    PauseAfterTrial,
    /// Something to be kept in the journal.
    Note {
        /// What.
        text: String,
        /// The time on the operator's clock.
        clock: Option<String>,
    },
    /// Play the recording, or stop it.
    Play {
        /// So many times as fast as it was.
        speed: f64,
        /// Whether it runs.
        plays: bool,
    },
    /// Go to a place in the recording.
    Seek {
        /// Where, s.
        t_s: f64,
    },
}

/// Below the loop's threads in rank: what is drawn must never delay what is measured. Where threads have no rank of their
/// own, nothing is done.
pub(crate) fn nice() {
    #[cfg(target_os = "linux")]
    if let Err(error) = rustix::process::nice(5) {
        tracing::debug!("the console's threads keep their rank: {error}");
    }
}
