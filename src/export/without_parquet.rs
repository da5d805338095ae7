//! Takes the place of the Parquet writer where the feature `parquet` is not built.

use std::path::{Path, PathBuf};

use super::error::ExportError;
use super::rows::Rows;

/// Refuses.
///
/// # Errors
/// Always: the feature is not built.
pub fn write(_folders: &[PathBuf], _file: &Path, _rows: Rows) -> Result<(), ExportError> {
    Err(ExportError::NotBuilt { option: "--parquet", feature: "parquet" })
}
