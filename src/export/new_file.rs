//! Files that an export makes, which never take the place of another one.

use std::path::Path;

use super::error::ExportError;
use crate::files::{self, Folder};

/// Refuses a file that exists.
///
/// # Errors
/// If it does.
pub fn refuse_existing(file: &Path) -> Result<(), ExportError> {
    if files::exists(file) { Err(ExportError::Exists(file.into())) } else { Ok(()) }
}

/// Writes a file as a whole.
///
/// # Errors
/// If it cannot be written.
pub fn write_new(file: &Path, bytes: &[u8]) -> Result<(), ExportError> {
    let above = Folder::open(file.parent().unwrap_or(Path::new("")));
    above
        .and_then(|above| above.write(Path::new(file.file_name().unwrap_or_default()), bytes))
        .map_err(ExportError::at(file))
}
