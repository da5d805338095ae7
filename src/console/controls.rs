//! What operators can ask for at a page or in the terminal. The subject's page can ask for nothing.

use serde::{Deserialize, Serialize};

use crate::dataset::ActionOrigin;
use crate::session::Event;

/// Receives the requests of operators.
pub trait Controls: Send + Sync {
    /// An operator asked for something.
    fn request(&self, request: Request, origin: ActionOrigin);

    /// An operator's page was opened.
    fn joined(&self, _origin: ActionOrigin) {}

    /// An operator's page was closed.
    fn left(&self, _origin: ActionOrigin) {}
}

/// What is chosen for a session from the lists of a laboratory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// The subject.
    Subject,
    /// The protocol.
    Protocol,
    /// The rig.
    Rig,
    /// The measured constants of the rig.
    Calibration,
}

/// A request of an operator.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Request {
    /// A command for the session.
    #[serde(rename = "word")]
    Command {
        /// The command.
        #[serde(rename = "word")]
        command: Event,
        /// Whether the operator confirmed it; needed for commands that cannot be undone.
        #[serde(rename = "sure", default)]
        confirmed: bool,
    },
    /// A pause after the trial under way.
    PauseAfterTrial,
    /// A note for the journal.
    Note {
        /// The note.
        text: String,
        /// Time of day on the operator's screen.
        clock: Option<String>,
    },
    /// Play a recording, or stop it.
    Play {
        /// Speed relative to real time.
        speed: f64,
        /// Whether the recording runs.
        plays: bool,
    },
    /// Go to a time of a recording.
    Seek {
        /// Time from the beginning of the recording, s.
        t_s: f64,
    },
    /// Choose a line of a list of the laboratory.
    Choose {
        /// The list.
        part: Part,
        /// Name of the line; `None` for none.
        name: Option<String>,
    },
    /// Begin a session with what is chosen.
    Begin {
        /// Number of the view that the operator saw; of another one nothing begins.
        number: u64,
    },
    /// Go on with an unfinished session of the laboratory.
    Resume {
        /// Its name in the list.
        session: String,
    },
}
