//! A session that was loaded and held against its own table.

use std::path::Path;

use crate::consistency::{self, Contradiction, SignalCheck};
use crate::dataset::{self, Session};

use super::calibration::UsedCalibration;
use super::failure::Failure;

/// A session, and its contradictions that the operator accepted.
pub struct CheckedSession {
    /// The session.
    pub session: Session,
    /// What it contradicts, and was accepted.
    pub accepted: Vec<Contradiction>,
}

impl CheckedSession {
    /// Holds the signals, corrected by `calibration`, against the table of the session in `folder`.
    ///
    /// # Errors
    /// If they contradict it in a way that is not among `accepted`, or the calibration cannot be used for the session.
    pub fn check_calibrated(
        &self,
        folder: &Path,
        calibration: &UsedCalibration,
        accepted: &[SignalCheck],
    ) -> Result<(), Failure> {
        let constants = UsedCalibration::constants(Some(calibration), self.session.lever)?;
        consistency::check_with_gains(&self.session, [constants.angle_gain, constants.torque_gain], accepted)
            .map_err(|found| Failure::Contradicts { session: folder.display().to_string(), found })
    }
}

/// Reads the session in `folder` and holds its signals against its table.
///
/// # Errors
/// If it cannot be read, or contradicts its table in a way that is not among `accepted`.
pub fn load_checked(folder: &Path, accepted: &[SignalCheck]) -> Result<CheckedSession, Failure> {
    let session = dataset::load(folder)?;
    let accepted = consistency::check(&session, accepted)
        .map_err(|found| Failure::Contradicts { session: folder.display().to_string(), found })?;
    Ok(CheckedSession { session, accepted })
}
