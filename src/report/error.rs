//! Errors of the report.

use std::io;
use std::path::PathBuf;

use crate::dataset::DatasetError;
use crate::json_file::JsonFileError;
use crate::study::StudyError;

/// Why a report cannot be written. Missing results are not an error; the report lists them.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The session cannot be read.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The study cannot be read.
    #[error(transparent)]
    Study(Box<StudyError>),
    /// A file exists but cannot be read.
    #[error("{}: cannot be read ({source}); make it readable or remove it", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// A result file has another format or content than expected.
    #[error("{source}. Write it again with: ramphold {verb}")]
    Content {
        /// File, line, field and message.
        source: JsonFileError,
        /// The verb that writes the file.
        verb: &'static str,
    },
    /// The folder that is to be laid beside holds no fit.
    #[error("{}: has no fit.json to lay beside; give the folder of another fit, such as results/window-300ms", folder.display())]
    NoFit {
        /// The folder.
        folder: PathBuf,
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

impl From<StudyError> for ReportError {
    fn from(error: StudyError) -> Self {
        Self::Study(Box::new(error))
    }
}
