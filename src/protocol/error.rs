//! What can be wrong with a protocol file, in words that say what to do.

use std::fmt;

/// Why a protocol file is not a protocol.
#[derive(Debug, thiserror::Error)]
pub enum ProtocolError {
    /// The file cannot be read.
    #[error(
        "{file}: cannot be read: {source}. Give the path of a protocol file, such as protocols/quick.json"
    )]
    Unreadable {
        /// The file as it was named.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is not UTF-8 text.
    #[error("{file}: line {line}: not UTF-8 text. Save the file as UTF-8")]
    NotText {
        /// The file as it was named.
        file: String,
        /// Line of the first byte that is not text.
        line: usize,
    },
    /// The text is not JSON.
    #[error("{file}: line {line}, column {column}: not JSON: {reason}. {advice}")]
    NotJson {
        /// The file as it was named.
        file: String,
        /// Where reading stopped.
        line: usize,
        /// Where reading stopped.
        column: usize,
        /// What the reader said.
        reason: String,
        /// What to do.
        advice: &'static str,
    },
    /// It is JSON, but no protocol that can be run.
    #[error("{file}: {}", Listed(problems))]
    Invalid {
        /// The file as it was named.
        file: String,
        /// Everything that is wrong, in the order of the file.
        problems: Vec<Problem>,
    },
}

/// One thing that is wrong with a protocol.
#[derive(Debug, Clone, PartialEq)]
pub struct Problem {
    /// Where in the JSON, such as `velocities_rad_s[2]`; empty for the whole document.
    pub path: String,
    /// Line of the file, from 1.
    pub line: usize,
    /// What stands there, as JSON; `None` if nothing does.
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

struct Listed<'a>(&'a [Problem]);

impl fmt::Display for Listed<'_> {
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
