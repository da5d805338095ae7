//! Why a session cannot be exported.

use std::io;
use std::path::PathBuf;

use crate::attach::AttachError;
use crate::dataset::DatasetError;
use crate::files::is_refusal;

/// Why an export failed.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A session cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An attachment of a session cannot be read.
    #[error(transparent)]
    Attached(Box<AttachError>),
    /// The target folder is not empty.
    #[error("{}: is not empty, and an export does not add to existing files; give a new or empty folder", .0.display())]
    NotEmpty(PathBuf),
    /// The target file exists.
    #[error("{}: exists already and is not overwritten; give another name", .0.display())]
    Exists(PathBuf),
    /// The subject's identifier cannot be a part of a BIDS file name.
    #[error(
        "{}, field subject.id: {id:?} cannot be a part of a file name; expected letters a to z, A to Z and digits only, \
         as BIDS asks (for instance {suggestion:?}). Change it there, or name one session's person with --participant",
        session.display()
    )]
    Subject {
        /// The session's description.
        session: PathBuf,
        /// The identifier.
        id: String,
        /// An identifier that can be used instead.
        suggestion: String,
    },
    /// The identifier that was asked for cannot be a part of a BIDS file name.
    #[error(
        "--participant {label:?} cannot be a part of a file name; expected letters a to z, A to Z and digits only, as BIDS asks \
         (for instance {suggestion:?})"
    )]
    Participant {
        /// The identifier.
        label: String,
        /// An identifier that can be used instead.
        suggestion: String,
    },
    /// No trial has any samples.
    #[error("{}: no trial has samples; there is nothing to export", .0.display())]
    Nothing(PathBuf),
    /// A session without a journal, in which nobody knows when its trials were.
    #[error(
        "{}: has no journal, so nobody knows when its trials were; {format} needs that. Use --mat, --bids or --parquet",
        session.display()
    )]
    NoTimes {
        /// The session.
        session: PathBuf,
        /// The format, such as `an XDF file`.
        format: &'static str,
    },
    /// A result table that cannot be read.
    #[error("{}: cannot be read as a table: {message}. Write it again with: ramphold fit", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A value outside the range of the format.
    #[error("{}: {channel} reaches {value}; the format holds values up to {limit}", path.display())]
    OutOfRange {
        /// The file that was to be written.
        path: PathBuf,
        /// The channel.
        channel: &'static str,
        /// The value.
        value: f64,
        /// The largest value of the format.
        limit: f64,
    },
    /// More than a variable of a .mat file can hold.
    #[error(
        "{}: the sessions make {bytes} bytes, and a .mat file of version 5 holds {limit}; export fewer sessions to a file",
        path.display()
    )]
    TooLarge {
        /// The file that was to be written.
        path: PathBuf,
        /// Bytes of the variable.
        bytes: usize,
        /// Most bytes of a variable.
        limit: usize,
    },
    /// The program was built without the feature that the option needs.
    #[error(
        "{option}: this program was built without the feature {feature}; build it with: \
         cargo build --release --features {feature}"
    )]
    NotBuilt {
        /// The option that needs the feature.
        option: &'static str,
        /// The cargo feature.
        feature: &'static str,
    },
    /// The crate that writes the format failed.
    #[error("{}: cannot be written: {message}", path.display())]
    Writer {
        /// The file.
        path: PathBuf,
        /// Its reason.
        message: String,
    },
    /// A file cannot be read or written.
    #[error("{}: cannot be copied or written: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}

impl From<AttachError> for ExportError {
    fn from(error: AttachError) -> Self {
        Self::Attached(Box::new(error))
    }
}

impl ExportError {
    /// An error of the operating system at `path`.
    pub(super) fn at(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }

    /// Whether the input is wrong, so that the exit code is 2.
    pub fn is_bad_input(&self) -> bool {
        match self {
            Self::File { source, .. } => is_refusal(source),
            Self::Writer { .. } => false,
            _ => true,
        }
    }
}
