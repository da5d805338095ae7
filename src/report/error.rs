//! Why there is no report.

use std::io;
use std::path::PathBuf;

use crate::dataset::DatasetError;

/// A report that cannot be written. What is merely missing is said in the report itself.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The session cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// A file is there and cannot be read.
    #[error("{}: cannot be read ({source}); expected a readable file, or none", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A result file is not what its name says.
    #[error("{}, line {line}, field {field}: {message}; expected a file of format {expected}. Make it again with: ramphold {verb}", path.display())]
    Form {
        /// The file.
        path: PathBuf,
        /// Line, the first being 1.
        line: usize,
        /// Path of the field.
        field: String,
        /// What is wrong.
        message: String,
        /// The format it should have.
        expected: &'static str,
        /// The verb that writes it.
        verb: &'static str,
    },
    /// The report cannot be written.
    #[error("{}: cannot be written: {source}", path.display())]
    Unwritable {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
}
