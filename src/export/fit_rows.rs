//! The rows of a session's `fit.csv`, for tables with a row for each trial.

use std::collections::BTreeMap;
use std::path::Path;

use super::error::ExportError;
use crate::files::{Folder, limits};

/// The rows of `fit.csv` by trial, each by column; none without that file.
///
/// # Errors
/// If the file cannot be read, or is no table with a number in its column `trial`.
pub fn fit_rows(session: &Path) -> Result<BTreeMap<u32, BTreeMap<String, String>>, ExportError> {
    const FIT: &str = "results/fit.csv";
    let path = session.join(FIT);
    let bytes = Folder::open(session).and_then(|folder| folder.read_if_there(FIT, limits::FIT_BYTES));
    let Some(bytes) = bytes.map_err(ExportError::at(&path))? else { return Ok(BTreeMap::new()) };
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
