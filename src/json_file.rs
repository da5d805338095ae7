//! Reads JSON files of every kind, with three errors: unreadable, not JSON, wrong value; and writes values as JSON.
//!
//! A protocol and a rig file of a CAN motor are read by [`protocol`](crate::protocol), which lists all their mistakes at once.

use std::collections::BTreeMap;
use std::fmt;
use std::io;
use std::marker::PhantomData;
use std::path::{Path, PathBuf};

use serde::de::{DeserializeOwned, Error, MapAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize};

use crate::files::{self, limits};

/// Why a JSON file cannot be used. `expected` says what the file should be.
#[derive(Debug, thiserror::Error)]
pub enum JsonFileError {
    /// The file cannot be read.
    #[error("{}: cannot be read ({source}); expected {expected}", .file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// What the file should be.
        expected: &'static str,
        /// The operating system's reason.
        source: io::Error,
    },
    /// The text is not JSON.
    #[error("{}, line {line}, column {column}: not JSON: {message}; expected {expected}", .file.display())]
    NotJson {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Column, from 1.
        column: usize,
        /// The parser's message.
        message: String,
        /// What the file should be.
        expected: &'static str,
    },
    /// A field is unknown or missing, or its value has a wrong type or is out of range.
    #[error("{}, line {line}, field {field}: {message}; expected {expected}", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Line, from 1.
        line: usize,
        /// Path of the field, such as `velocities_rad_s[2]`; `.` for the whole file.
        field: String,
        /// The parser's message, with the value that was expected.
        message: String,
        /// What the file should be.
        expected: &'static str,
    },
}

impl JsonFileError {
    /// Line of the error, from 1.
    pub fn line(&self) -> usize {
        match self {
            Self::Unreadable { .. } => 1,
            Self::NotJson { line, .. } | Self::Value { line, .. } => *line,
        }
    }

    /// Path of the field and the message, for a caller whose own error names file and line.
    pub fn field_and_message(&self) -> (String, String) {
        match self {
            Self::Unreadable { source, .. } => (".".to_owned(), source.to_string()),
            Self::NotJson { line, column, message, .. } => {
                (".".to_owned(), format!("not JSON: {message} at line {line} column {column}"))
            }
            Self::Value { line, field, message, .. } => (field.clone(), format!("{message} at line {line}")),
        }
    }
}

/// Reads a JSON file. `expected` says in messages what the file should be, such as `"the file of a study"`.
///
/// # Errors
/// If the file cannot be read, is not JSON, or does not describe a `T`.
pub fn read<T: DeserializeOwned>(file: &Path, expected: &'static str) -> Result<T, JsonFileError> {
    parse(&read_text(file, expected)?, file, expected)
}

/// Reads the text of a JSON file without parsing it.
///
/// # Errors
/// If the file cannot be read or is not UTF-8.
pub fn read_text(file: &Path, expected: &'static str) -> Result<String, JsonFileError> {
    files::read_text(file, limits::SETTINGS_BYTES).map_err(|source| JsonFileError::Unreadable {
        file: file.to_owned(),
        expected,
        source,
    })
}

/// Parses the text of a JSON file; `file` is its name for messages.
///
/// ```
/// use std::path::Path;
/// use ramphold::json_file::parse;
///
/// let numbers: Result<Vec<u8>, _> = parse("[1,\n-2]", Path::new("numbers.json"), "a list of numbers");
/// let message = numbers.unwrap_err().to_string();
/// assert!(message.starts_with("numbers.json, line 2, field [1]: "), "{message}");
/// ```
///
/// # Errors
/// If the text is not JSON, or does not describe a `T`.
pub fn parse<T: DeserializeOwned>(
    text: &str,
    file: &Path,
    expected: &'static str,
) -> Result<T, JsonFileError> {
    let mut deserializer = serde_json::Deserializer::from_str(text);
    let error = match serde_path_to_error::deserialize(&mut deserializer) {
        Ok(value) => match deserializer.end() {
            Ok(()) => return Ok(value),
            Err(error) => (".".to_owned(), error),
        },
        Err(error) => (error.path().to_string(), error.into_inner()),
    };
    let (field, error) = error;
    let message = error.to_string();
    // The parser ends its message with the place, which is given separately.
    let message =
        message.rsplit_once(" at line ").map_or(message.as_str(), |(message, _)| message).to_owned();
    let (file, line) = (file.to_owned(), error.line());
    Err(if error.is_data() {
        JsonFileError::Value { file, line, field, message, expected }
    } else {
        JsonFileError::NotJson { file, line, column: error.column(), message, expected }
    })
}

/// Reads a JSON object whose names are the file's own, none of them twice: for `deserialize_with` of such a field. The fields of a
/// structure are checked anyway, but of a map the last value of a name would count without a word.
///
/// # Errors
/// If a name is there twice, or a value is none.
pub fn unique_names<'de, D: Deserializer<'de>, V: Deserialize<'de>>(
    deserializer: D,
) -> Result<BTreeMap<String, V>, D::Error> {
    deserializer.deserialize_map(UniqueNames(PhantomData))
}

struct UniqueNames<V>(PhantomData<V>);

impl<'de, V: Deserialize<'de>> Visitor<'de> for UniqueNames<V> {
    type Value = BTreeMap<String, V>;

    fn expecting(&self, formatter: &mut fmt::Formatter) -> fmt::Result {
        formatter.write_str("a JSON object")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut object: A) -> Result<Self::Value, A::Error> {
        let mut read = BTreeMap::new();
        while let Some((name, value)) = object.next_entry::<String, V>()? {
            let message = format!("{name:?} is written twice; expected each name once");
            if read.insert(name, value).is_some() {
                return Err(A::Error::custom(message));
            }
        }
        Ok(read)
    }
}

/// A value as JSON for people to read, with an end of line.
pub fn pretty(value: &impl Serialize) -> String {
    serde_json::to_string_pretty(value).expect("values of this program have a JSON form") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(text: &str) -> String {
        parse::<BTreeMap<String, Vec<f64>>>(text, Path::new("x.json"), "lists of numbers")
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn a_wrong_value_is_reported_with_line_and_field() {
        assert_eq!(
            error("{\n\"a\": [1, true]}"),
            "x.json, line 2, field a[1]: invalid type: boolean `true`, expected f64; expected lists of numbers"
        );
    }

    #[test]
    fn text_that_is_not_json_is_reported_with_line_and_column() {
        for text in ["{", "{\"a\": [1,]}", "{} {}"] {
            let message = error(text);
            assert!(
                message.starts_with("x.json, line 1, column ") && message.contains(": not JSON: "),
                "{message}"
            );
        }
    }

    #[test]
    fn a_missing_file_is_reported_with_its_name() {
        let error = read::<Vec<f64>>(Path::new("no/such.json"), "a list of numbers").unwrap_err().to_string();
        assert!(
            error.starts_with("no/such.json: cannot be read (")
                && error.ends_with("expected a list of numbers")
        );
    }
}
