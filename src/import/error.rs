//! Errors of an import: file, column, what was expected, what to do.

use std::fmt;
use std::io;
use std::path::PathBuf;

use super::recording::RECORDING_FILES;
use crate::json_file::JsonFileError;
use crate::protocol::{Problem, ProtocolError};

/// Why a recording cannot be imported.
#[derive(Debug, thiserror::Error)]
pub enum ImportError {
    /// The source cannot be read.
    #[error("{}: cannot be read: {source}; give a folder of CSV files, or {RECORDING_FILES}", path.display())]
    Unreadable {
        /// The file or folder.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The source is of a kind that is not read.
    #[error("{}: {found}; expected {expected}", path.display())]
    Source {
        /// The file or folder.
        path: PathBuf,
        /// What was found.
        found: String,
        /// What was expected, and what to do.
        expected: &'static str,
    },
    /// A cell of a table is no number.
    #[error("{}, line {line}, column {column}: {found:?} is no number; remove the row, or write the number with a point", path.display())]
    Cell {
        /// The file.
        path: PathBuf,
        /// Line, from 1.
        line: u64,
        /// Name of the column.
        column: String,
        /// What stands there.
        found: String,
    },
    /// The mapping cannot be read.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// The mapping is not JSON.
    #[error(transparent)]
    NotJson(ProtocolError),
    /// The mapping has wrong or missing fields; the message lists all of them.
    #[error("{file}: {}", MappingProblems(problems))]
    Mapping {
        /// The file.
        file: String,
        /// What is wrong.
        problems: Vec<Problem>,
    },
    /// A column that the mapping names is not in the source, or cannot be used.
    #[error("{table}: {why}, which the mapping names as {role}; its columns are {columns}")]
    NoColumn {
        /// The table.
        table: String,
        /// That the column is not there, or why it cannot be used.
        why: String,
        /// What the mapping takes it for.
        role: &'static str,
        /// The columns that there are.
        columns: String,
    },
    /// The signals cannot be what the mapping takes them for.
    #[error("{reason}")]
    Implausible {
        /// What was found, and what to do.
        reason: String,
    },
    /// No trial was found.
    #[error("no trial found: {reason}")]
    NoTrial {
        /// Why, and what to do.
        reason: String,
    },
    /// The session's folder is there already, or cannot be written.
    #[error("{}: {reason}", path.display())]
    Write {
        /// The file or folder.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
}

struct MappingProblems<'a>(&'a [Problem]);

impl fmt::Display for MappingProblems<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "the mapping has {} mistakes", self.0.len())?;
        self.0.iter().try_for_each(|problem| write!(formatter, "\n  {problem}"))
    }
}
