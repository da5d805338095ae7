//! What people did at a console, for the journal. The session goes by what came of it, which the journal tells beside
//! this; here stands who did what, and what they wrote down.

use serde::{Deserialize, Serialize};

use crate::session::Event;

/// The longest note, in bytes.
pub const LONGEST_NOTE: usize = 1000;

/// Something done at a console.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperatorAction {
    /// The console was opened.
    Opened {
        /// The wrist in the handle, as the person's display mirrors it.
        wrist: Wrist,
    },
    /// An operator came to the console.
    Joined,
    /// An operator left it, or was no longer heard of.
    Left,
    /// No operator was there for too long: the session is to pause after the trial.
    Missed {
        /// For how long, s.
        after_s: f64,
    },
    /// The operator gave a word to the session.
    Said {
        /// The word.
        word: Event,
    },
    /// The operator asked for a pause once the trial under way is over.
    AskedForPauseAfterTrial,
    /// The operator wrote something down.
    Noted {
        /// What.
        text: String,
        /// The time on the operator's clock, as the operator's screen gave it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        clock: Option<String>,
    },
}

/// Where something was done.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ActionOrigin {
    /// The operator's page in a browser.
    Page,
    /// The terminal.
    Terminal,
    /// The program itself.
    Program,
}

/// Which wrist is in the handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrist {
    /// The left one.
    Left,
    /// The right one.
    #[default]
    Right,
}

/// A deed with its place in the session.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AuditEntry {
    /// Samples since the session was started or resumed.
    pub sample: u64,
    /// Where it was done.
    pub desk: ActionOrigin,
    /// What.
    pub deed: OperatorAction,
}
