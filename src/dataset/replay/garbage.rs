//! Bytes in the files of a session that belong to nothing.

use std::fmt;

use crate::files::excerpt;

/// Bytes behind the end of a file that are no part of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Garbage {
    /// The file.
    pub file: String,
    /// How many bytes.
    pub bytes: u64,
    /// The program died while it wrote the file, which explains them.
    pub is_torn_end: bool,
}

impl fmt::Display for Garbage {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = if self.is_torn_end { ": the program ended while it wrote them" } else { "" };
        write!(out, "{}: {} bytes behind its end belong to no record{why}", excerpt(&self.file), self.bytes)
    }
}
