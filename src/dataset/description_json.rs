//! Reading a JSON file of a session folder, with an error that names file, line and field.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::error::{DatasetError, FilePlace};
use crate::files::excerpt;
use crate::json_file;

/// Parses the text of a JSON file of a session; `name` is the file's name for messages.
pub(super) fn parse_json<T: DeserializeOwned>(name: &str, text: &str) -> Result<T, DatasetError> {
    json_file::parse(text, Path::new(name), "a session description").map_err(|error| {
        let (path, message) = error.field_and_message();
        let column = (path != ".").then(|| format!("field {path}").into());
        let place = FilePlace { file: name.into(), line: Some(error.line() as u64), column };
        DatasetError::Json { at: place, message }
    })
}

/// Checks the field `format` of a file of a session, which is at `at`.
pub(super) fn check_format(
    at: impl FnOnce() -> FilePlace,
    found: &str,
    expected: &'static str,
) -> Result<(), DatasetError> {
    if found == expected {
        return Ok(());
    }
    Err(DatasetError::UnknownFormat { at: at(), found: excerpt(found).into_owned(), expected })
}
