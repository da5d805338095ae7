//! Takes the place of the NWB writer where the feature `matlab`, which brings HDF5, is not built.

use std::path::Path;

use super::error::ExportError;

/// Refuses.
///
/// # Errors
/// Always: the feature is not built.
pub fn write(_folder: &Path, _file: &Path) -> Result<(), ExportError> {
    Err(ExportError::NotBuilt { option: "--nwb", feature: "matlab" })
}
