//! The calibration of a rig from the rig trials in a session's folder.

use std::path::Path;

use crate::calibrate::{CalibrationOutcome, RigComparison, calibrate, compare};
use crate::dataset::{PROGRAM, RigCalibration, RigTrials, load_rig_trials};

use super::failure::Failure;
use super::wall_clock::now_utc;

/// Fits the constants of the rig to the rig trials of the session in `folder`; the calibration has the name of the folder and the time.
///
/// # Errors
/// If the rig trials cannot be read, or none of them can be analysed.
pub fn calibrate_rig(folder: &Path) -> Result<CalibrationOutcome, Failure> {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let name = absolute.file_name().unwrap_or_default().to_string_lossy();
    calibrate_from(&load_rig_trials(folder)?, &name, folder.display().to_string())
}

/// Fits the constants of the rig to rig trials that no folder holds; the calibration has the name `session` and the time.
///
/// # Errors
/// If none of the trials can be analysed.
pub fn calibrate_given_rig(trials: &RigTrials, session: &str) -> Result<CalibrationOutcome, Failure> {
    calibrate_from(trials, session, session.to_owned())
}

/// `shown` is the name of the session in messages.
fn calibrate_from(trials: &RigTrials, name: &str, shown: String) -> Result<CalibrationOutcome, Failure> {
    let mut outcome =
        calibrate(trials, PROGRAM, name).map_err(|source| Failure::Calibrate { session: shown, source })?;
    outcome.calibration.made_utc = Some(now_utc());
    Ok(outcome)
}

/// Compares the empty-handle trials of the session in `folder` with an earlier calibration.
///
/// # Errors
/// If the rig trials cannot be read, or none of them can be compared.
pub fn compare_rig(folder: &Path, earlier: &RigCalibration) -> Result<RigComparison, Failure> {
    compare_given_rig(&load_rig_trials(folder)?, &folder.display().to_string(), earlier)
}

/// Compares the empty-handle trials among rig trials that no folder holds with an earlier calibration; `session` is their name.
///
/// # Errors
/// If none of them can be compared.
pub fn compare_given_rig(
    trials: &RigTrials,
    session: &str,
    earlier: &RigCalibration,
) -> Result<RigComparison, Failure> {
    compare(trials, earlier).map_err(|source| Failure::Calibrate { session: session.to_owned(), source })
}
