//! The calibration of a rig from the rig trials in a session's folder.

use std::path::Path;

use crate::calibrate::{CalibrationOutcome, RigComparison, calibrate, compare};
use crate::dataset::{PROGRAM, RigCalibration, load_rig_trials};

use super::failure::Failure;
use super::wall_clock::now_utc;

/// Fits the constants of the rig to the rig trials of the session in `folder`; the calibration has the name of the folder and the time.
///
/// # Errors
/// If the rig trials cannot be read, or none of them can be analysed.
pub fn calibrate_rig(folder: &Path) -> Result<CalibrationOutcome, Failure> {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = absolute.file_name().unwrap_or_default().to_string_lossy();
    let trials = load_rig_trials(folder)?;
    let mut outcome = calibrate(&trials, PROGRAM, &name)
        .map_err(|source| Failure::Calibrate { session: folder.display().to_string(), source })?;
    outcome.calibration.made_utc = Some(now_utc());
    Ok(outcome)
}

/// Compares the empty-handle trials of the session in `folder` with an earlier calibration.
///
/// # Errors
/// If the rig trials cannot be read, or none of them can be compared.
pub fn compare_rig(folder: &Path, earlier: &RigCalibration) -> Result<RigComparison, Failure> {
    compare(&load_rig_trials(folder)?, earlier)
        .map_err(|source| Failure::Calibrate { session: folder.display().to_string(), source })
}
