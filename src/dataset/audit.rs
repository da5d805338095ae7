//! Operators' actions at a console, as the journal keeps them: who did what, and the notes. The resulting transitions of
//! the session are journal entries of their own.

use serde::{Deserialize, Serialize};

use crate::session::Event;

/// Longest note, in bytes.
pub const LONGEST_NOTE: usize = 1000;

/// An action at a console.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OperatorAction {
    /// The console was opened.
    Opened {
        /// Wrist in the handle; the subject's display is mirrored to its side.
        wrist: Wrist,
    },
    /// An operator's page was opened.
    Joined,
    /// An operator's page was closed, or its connection was lost.
    Left,
    /// No operator's page was open for too long: the session pauses after the trial.
    Missed {
        /// Time without an operator's page, s.
        after_s: f64,
    },
    /// The operator gave a command.
    #[serde(rename = "said")]
    Commanded {
        /// The command.
        #[serde(rename = "word")]
        command: Event,
    },
    /// The operator asked for a pause after the trial under way.
    #[serde(rename = "asked_for_pause_after_trial")]
    RequestedPauseAfterTrial,
    /// A stream has given no sample for some time.
    StreamSilent {
        /// Its name in the rig file.
        stream: String,
        /// For how long, s.
        for_s: f64,
    },
    /// A stream that was silent gives samples again.
    StreamBack {
        /// Its name in the rig file.
        stream: String,
        /// After how long, s.
        after_s: f64,
    },
    /// A channel of EMG of a stream keeps one value, as that of an amplifier that has stopped.
    StreamFrozen {
        /// Name of the stream in the rig file.
        stream: String,
        /// Name of the channel in the rig file.
        channel: String,
        /// The value, in the unit of the channel.
        value: f64,
        /// For how long, s.
        for_s: f64,
    },
    /// A channel of EMG of a stream changes again.
    StreamLive {
        /// Name of the stream in the rig file.
        stream: String,
        /// Name of the channel in the rig file.
        channel: String,
        /// After how long, s.
        after_s: f64,
    },
    /// The time stamps of a stream cannot be when its samples were taken.
    StreamStampsOff {
        /// Its name in the rig file.
        stream: String,
        /// How far they are behind the clock when the samples come, s; negative in the future.
        late_s: f64,
        /// How many samples had been recorded in this run of the program when they were last right.
        after_samples: u64,
    },
    /// The time stamps of a stream are right again.
    StreamStampsRight {
        /// Its name in the rig file.
        stream: String,
        /// How many samples had been recorded in this run of the program by then.
        after_samples: u64,
    },
    /// The samples of a stream cannot be written any more.
    StreamNotRecorded {
        /// Its name in the rig file.
        stream: String,
        /// Why.
        because: String,
    },
    /// The operator wrote a note.
    Noted {
        /// The note.
        text: String,
        /// Time of day on the operator's screen.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        clock: Option<String>,
    },
}

/// Where an action came from.
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

/// The wrist in the handle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Wrist {
    /// The left wrist.
    Left,
    /// The right wrist.
    #[default]
    Right,
}

/// How far stamps are from a clock, for a message: `3.000 s ahead of`; negative in the future.
pub fn stamps_from_clock(late_s: f64) -> String {
    format!("{:.3} s {}", late_s.abs(), if late_s < 0.0 { "ahead of" } else { "behind" })
}

/// An action with its time and origin.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AuditEntry {
    /// Samples since the session was started or resumed.
    pub sample: u64,
    /// Where the action came from.
    #[serde(rename = "desk")]
    pub origin: ActionOrigin,
    /// The action.
    #[serde(rename = "deed")]
    pub action: OperatorAction,
}
