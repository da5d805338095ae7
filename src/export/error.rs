//! Why a session cannot be exported.

use std::io;
use std::path::PathBuf;

use crate::dataset::DatasetError;

/// An export that could not be made.
#[derive(Debug, thiserror::Error)]
pub enum ExportError {
    /// A session cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The target is there and holds something.
    #[error("{}: is not empty; an export never mixes with what is there. Choose a new folder, or empty this one", .0.display())]
    NotEmpty(PathBuf),
    /// The target is there.
    #[error("{}: is there already; an export never overwrites anything. Choose another name", .0.display())]
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
        /// One that would do.
        suggestion: String,
    },
    /// No trial has any samples.
    #[error("{}: no trial has samples; there is nothing to export", .0.display())]
    Nothing(PathBuf),
    /// A result table that cannot be read.
    #[error("{}: cannot be read as a table: {message}. Make it again with: ramphold fit", path.display())]
    Table {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        message: String,
    },
    /// A value that the format has no room for.
    #[error("{}: {channel} reaches {value}; the format holds values up to {limit}", path.display())]
    OutOfRange {
        /// The file that was to be written.
        path: PathBuf,
        /// The channel.
        channel: &'static str,
        /// The value.
        value: f64,
        /// The greatest it can hold.
        limit: f64,
    },
    /// The program was built without this part.
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
    /// The Parquet writer refuses.
    #[error("{}: cannot be written: {message}", path.display())]
    Parquet {
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

impl ExportError {
    /// An error of the operating system at `path`.
    pub(super) fn at(path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { path, source }
    }

    /// Whether what was given is at fault, rather than the work.
    pub fn is_bad_input(&self) -> bool {
        !matches!(self, Self::File { .. } | Self::Parquet { .. })
    }
}
