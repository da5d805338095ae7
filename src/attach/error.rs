//! Why a recording cannot be attached.

use std::path::PathBuf;

use crate::dataset::{DatasetError, RecordError};
use crate::import::ImportError;

/// Why a recording cannot be attached to a session.
#[derive(Debug, thiserror::Error)]
pub enum AttachError {
    /// The session cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The recording cannot be read.
    #[error(transparent)]
    Recording(#[from] ImportError),
    /// The session's folder cannot be written.
    #[error(transparent)]
    Write(#[from] RecordError),
    /// Something in the recording is not as expected.
    #[error("{}: {found}; expected {expected}", file.display())]
    Unexpected {
        /// The recording.
        file: PathBuf,
        /// What was found.
        found: String,
        /// What was expected, and what to do.
        expected: String,
    },
    /// The ramps of the session are not in the recording.
    #[error("{}: {reason}", file.display())]
    NotAligned {
        /// The recording.
        file: PathBuf,
        /// Why, and what to do.
        reason: String,
    },
    /// An attachment of that name is there already.
    #[error("{}: is there already and is not overwritten; give another --name", .0.display())]
    Exists(PathBuf),
}

impl AttachError {
    /// Whether the input is wrong, so that the exit code is 2.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::Write(_))
    }
}
