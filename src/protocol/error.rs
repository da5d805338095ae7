//! Errors of a protocol file: what is wrong, where, what was expected and what to do.

use std::fmt;

/// Why a protocol file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ProtocolError {
    /// The file cannot be read.
    #[error(
        "{file}: cannot be read: {source}. Give the path of a protocol file, such as protocols/quick.json"
    )]
    Unreadable {
        /// The name of the file as it was given.
        file: String,
        /// The operating system's reason.
        source: std::io::Error,
    },
    /// The file is not UTF-8 text.
    #[error("{file}: line {line}: not UTF-8 text. Save the file as UTF-8")]
    NotText {
        /// The name of the file as it was given.
        file: String,
        /// Line of the first byte that is not text.
        line: usize,
    },
    /// The text is not JSON.
    #[error("{file}: line {line}, column {column}: not JSON: {reason}. {advice}")]
    NotJson {
        /// The name of the file as it was given.
        file: String,
        /// Position of the error.
        line: usize,
        /// Position of the error.
        column: usize,
        /// The parser's reason.
        reason: String,
        /// What to do.
        advice: &'static str,
    },
    /// The file is of another kind that this program knows.
    #[error("{file}: is {what}, not a protocol. {advice}")]
    OtherKind {
        /// The name of the file as it was given.
        file: String,
        /// What it is.
        what: &'static str,
        /// What to do.
        advice: String,
    },
    /// The file is JSON, but not a protocol that can be run.
    #[error("{file}: {}", ProblemList(problems))]
    Invalid {
        /// The name of the file as it was given.
        file: String,
        /// All mistakes, in the order of the file.
        problems: Vec<Problem>,
    },
}

/// One mistake in a protocol file.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Path of the field, such as `velocities_rad_s[2]`; empty for the whole document.
    pub path: String,
    /// Line of the file, from 1.
    pub line: usize,
    /// The value as JSON; `None` if it is missing.
    pub value: Option<String>,
    /// What was expected.
    pub expected: String,
    /// What to do.
    pub advice: String,
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = if self.path.is_empty() { "the protocol" } else { &self.path };
        match &self.value {
            Some(value) => write!(f, "line {}: {path} is {value}", self.line)?,
            None => write!(f, "line {}: {path} is missing", self.line)?,
        }
        write!(f, "\n    expected: {}", self.expected)?;
        if !self.advice.is_empty() {
            write!(f, "\n    to do: {}", self.advice)?;
        }
        Ok(())
    }
}

struct ProblemList<'a>(&'a [Problem]);

impl fmt::Display for ProblemList<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            [_] => write!(f, "one thing is wrong")?,
            problems => write!(f, "{} things are wrong", problems.len())?,
        }
        for problem in self.0 {
            write!(f, "\n  {problem}")?;
        }
        Ok(())
    }
}
