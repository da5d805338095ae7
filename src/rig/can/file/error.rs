//! What can be wrong with a rig file, or with a protocol on this rig.

use std::fmt;

use crate::protocol::{Problem, ProtocolError};

/// Why a rig cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum CanRigFileError {
    /// The file cannot be read.
    #[error(
        "{file}: cannot be read: {source}. Give the path of a rig file; docs/how-to/real-motor.md says how to write one. Nothing is armed without it"
    )]
    Unreadable {
        /// The file as it was named.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The text is not JSON.
    #[error(transparent)]
    NotJson(ProtocolError),
    /// It is JSON, but no rig that can be armed.
    #[error("{file}: {}", ProblemLines(problems))]
    Invalid {
        /// The file as it was named.
        file: String,
        /// Everything that is wrong, in the order of the file.
        problems: Vec<Problem>,
    },
    /// The rig is right, the protocol is right, and they do not go together.
    #[error("{file}: the protocol cannot run on this rig:{}", Bullets(reasons))]
    Unsuitable {
        /// The rig file as it was named.
        file: String,
        /// Why not.
        reasons: Vec<String>,
    },
}

struct ProblemLines<'a>(&'a [Problem]);

impl fmt::Display for ProblemLines<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [_] => write!(formatter, "one thing is wrong")?,
            problems => write!(formatter, "{} things are wrong", problems.len())?,
        }
        self.0.iter().try_for_each(|problem| write!(formatter, "\n  {problem}"))
    }
}

struct Bullets<'a>(&'a [String]);

impl fmt::Display for Bullets<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|reason| write!(formatter, "\n  - {reason}"))
    }
}
