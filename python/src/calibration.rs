//! The calibration of a rig.

use std::path::{Path, PathBuf};

use pyo3::prelude::*;
use ramphold::app::{calibrate_rig, compare_rig};
use ramphold::calibrate::CalibrationOutcome;
use ramphold::dataset::RigCalibration;

use crate::background;
use crate::errors::exception;

/// Calibrates the rig from the rig trials in the session's folder `path`: the text of rig-calibration.json, and as JSON what
/// `ramphold calibrate --json` prints.
#[pyfunction]
pub fn calibrate(py: Python<'_>, path: PathBuf) -> PyResult<(String, String)> {
    Ok(texts(&background::run(py, None, move |_| calibrate_rig(&path))?.map_err(exception)?))
}

/// The text of rig-calibration.json, and as JSON what `ramphold calibrate --json` prints.
pub fn texts(outcome: &CalibrationOutcome) -> (String, String) {
    let text = String::from_utf8_lossy(&outcome.calibration.text()).into_owned();
    (text, outcome.to_json().to_string())
}

/// Reads the text of a calibration and checks it; `name` is its name in messages.
#[pyfunction]
pub fn check_calibration(text: &str, name: &str) -> PyResult<()> {
    RigCalibration::parse(text, Path::new(name)).map(drop).map_err(exception)
}

/// Compares the empty-handle trials in the session's folder `path` with a calibration: what `ramphold calibrate --compare --json` prints.
#[pyfunction]
pub fn compare_calibration(py: Python<'_>, text: &str, path: PathBuf) -> PyResult<String> {
    let earlier = RigCalibration::parse(text, Path::new("calibration")).map_err(exception)?;
    let comparison = background::run(py, None, move |_| compare_rig(&path, &earlier))?;
    Ok(comparison.map_err(exception)?.to_json().to_string())
}
