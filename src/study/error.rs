//! What can be wrong with a study, a unit of it, or a person in it.

use std::io;
use std::path::PathBuf;

use super::part::PartError;
use crate::dataset::{DatasetError, RecordError};
use crate::fit::PreprocessingError;
use crate::protocol::{ProtocolError, TooShort};
use crate::rig::Fault;
use crate::rig::virtual_wrist::{PersonError, RigFileError};
use crate::schedule::DrawError;

/// A study that cannot be done.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The file cannot be read.
    #[error("{}: cannot be read ({source}); expected the JSON file of a study", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// It is not JSON, or a field is not known, missing or of another kind.
    #[error("{}, line {line}, field {field}: {message}; see protocols/study.schema.json", .file.display())]
    Json {
        /// The file.
        file: PathBuf,
        /// Line in it.
        line: usize,
        /// Path of the field.
        field: String,
        /// The parser's words.
        message: String,
    },
    /// A value that no study has.
    #[error("{}, field {field}: {found}; expected {expected}", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// The value.
        found: String,
        /// What it can be.
        expected: &'static str,
    },
    /// Its protocol cannot be run.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// Its average person is none.
    #[error(transparent)]
    Person(#[from] PersonError),
    /// Its rig is none.
    #[error(transparent)]
    Rig(#[from] RigFileError),
    /// The folder belongs to something else.
    #[error("{}: {found}; {advice}", .folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What is in it.
        found: String,
        /// What to do.
        advice: &'static str,
    },
    /// A file of the study cannot be written or read.
    #[error("{}: {source}. Check the disk; what is done is kept, and --resume goes on from there", .path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A part that was done is not there, or is not whole.
    #[error(transparent)]
    Part(#[from] PartError),
    /// A table that is no study's.
    #[error("{}, line {line}: {message}", .file.display())]
    Table {
        /// The file.
        file: PathBuf,
        /// Line in it.
        line: u64,
        /// What is wrong, and what was expected.
        message: String,
    },
}

impl StudyError {
    /// An error of the operating system at `path`.
    pub fn at(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }

    /// Whether what was given is at fault, rather than the work.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::File { .. } | Self::Part(_))
    }
}

/// A session of a study that gives no estimates. The others do.
#[derive(Debug, thiserror::Error)]
pub enum UnitError {
    /// Its trials cannot be ordered.
    #[error(transparent)]
    Draw(#[from] DrawError),
    /// A velocity that the ramp cannot reach.
    #[error(transparent)]
    TooShort(#[from] TooShort),
    /// The session ended before its time.
    #[error("the session ended with {left} trials left to do{}", fault.map_or(String::new(), |fault| format!(": {fault}")))]
    Ended {
        /// Trials left.
        left: usize,
        /// The fault that ended it, if one did.
        fault: Option<Fault>,
    },
    /// The session cannot be kept.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The session cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// Its protocol, which says how to look at it, cannot be read.
    #[error(transparent)]
    Protocol(#[from] ProtocolError),
    /// The session cannot be analysed.
    #[error(transparent)]
    Prepare(#[from] PreprocessingError),
}

/// Something about the persons that keeps a table from holding all of them. Each is said; the rest is computed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum Problem {
    /// A session failed.
    #[error("{subject}, session {session}: {reason}. It is not in the study's tables")]
    Failed {
        /// Who.
        subject: String,
        /// Which session.
        session: u32,
        /// Why.
        reason: String,
    },
    /// A person was measured with another protocol.
    #[error(
        "{subject}: measured with another protocol ({difference}). The rows are in study.csv and in no other table; analyse \
         persons with different protocols apart"
    )]
    OtherProtocol {
        /// Who.
        subject: String,
        /// In what.
        difference: String,
    },
    /// A person lacks conditions.
    #[error(
        "{subject}: no usable trial of {} in {} of {of} conditions (first: {first}). Left out of the analysis of variance of \
         that quantity; scripts/mixed-model uses all rows", .quantity, .missing
    )]
    Missing {
        /// Who.
        subject: String,
        /// Which quantity lacks values.
        quantity: &'static str,
        /// How many conditions.
        missing: usize,
        /// Of how many.
        of: usize,
        /// The first of them.
        first: String,
    },
    /// A person is there twice.
    #[error(
        "{subject}: there twice ({place}). Only the first is in the tables; if these are repeated sessions of one person, say \
         \"repeated\": true in the study file"
    )]
    Twice {
        /// Who.
        subject: String,
        /// Where the second one is.
        place: String,
    },
    /// Fewer than two persons.
    #[error(
        "{persons} of the persons have all conditions; at least 2 are needed for statistics. Means are given where there are any"
    )]
    TooFew {
        /// How many there are.
        persons: usize,
    },
}
