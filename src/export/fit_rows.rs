//! The rows of a session's `fit.csv`, for tables with a row for each trial.

use std::collections::BTreeMap;
use std::path::Path;

use super::current_results::is_outdated;
use super::error::ExportError;
use crate::dataset::Session;
use crate::files::{Folder, limits};

/// The rows of `fit.csv` of the session in `folder` by trial, each by column; none without that file, or if the fit was made before the
/// session was changed.
///
/// # Errors
/// If the file cannot be read, or is no table with a number in its column `trial`.
pub fn fit_rows(
    folder: &Path,
    session: &Session,
) -> Result<BTreeMap<u32, BTreeMap<String, String>>, ExportError> {
    const FIT: &str = "results/fit.csv";
    let path = folder.join(FIT);
    let opened = Folder::open(folder).map_err(ExportError::at(&path))?;
    let bytes = opened.read_if_there(FIT, limits::FIT_BYTES).map_err(ExportError::at(&path))?;
    let Some(bytes) = bytes else { return Ok(BTreeMap::new()) };
    if is_outdated(&opened, "results/fit.json", limits::FIT_BYTES, &session.digest())? {
        return Ok(BTreeMap::new());
    }
    let bad = |message: String| ExportError::Table { path: path.clone(), message };
    let mut reader = csv::Reader::from_reader(bytes.as_slice());
    let columns = reader.headers().map_err(|error| bad(error.to_string()))?.len();
    if columns > limits::MAX_COLUMNS {
        return Err(bad(format!("{columns} columns; expected at most {}", limits::MAX_COLUMNS)));
    }
    let mut fits = BTreeMap::new();
    for row in reader.deserialize() {
        let row: BTreeMap<String, String> = row.map_err(|error| bad(error.to_string()))?;
        let trial = row.get("trial").and_then(|text| text.parse().ok());
        fits.insert(trial.ok_or_else(|| bad("a row has no number in its column trial".into()))?, row);
    }
    Ok(fits)
}
