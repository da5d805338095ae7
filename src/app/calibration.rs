//! The calibration that an analysis uses: the one that the operator names, or the one in the session's folder.

use std::path::{Path, PathBuf};

use crate::dataset::{RIG_CALIBRATION, RigCalibration, open_session, sha256, utc_seconds};
use crate::diagnose::RigKnowledge;
use crate::files::{self, limits};
use crate::fit::RigConstants;
use crate::wrist::Lever;

use super::console::Console;
use super::failure::Failure;
use super::wall_clock::seconds_now;

/// What stands for no calibration on the command line, though the session's folder has one.
const NONE: &str = "none";

/// Largest difference of the clocks of two computers that nobody needs to hear of, s.
const CLOCKS_DIFFER_S: i64 = 3600;

/// A calibration that was read.
#[derive(Debug, Clone)]
pub struct UsedCalibration {
    /// The calibration.
    pub calibration: RigCalibration,
    /// SHA-256 of the file, in hexadecimal digits.
    pub sha256: String,
    /// The file, for messages.
    pub file: PathBuf,
    /// The file's bytes.
    pub bytes: Vec<u8>,
}

impl UsedCalibration {
    /// The calibration in `given`, a file that the operator names; of the word `none`, none.
    ///
    /// # Errors
    /// If it cannot be read or is no calibration.
    pub fn given(given: &Path) -> Result<Option<Self>, Failure> {
        if given == Path::new(NONE) {
            return Ok(None);
        }
        let bytes = files::read(given, limits::SETTINGS_BYTES)
            .map_err(|source| Failure::Read { file: given.display().to_string(), source })?;
        Self::parse(bytes, given.to_owned()).map(Some)
    }

    /// The calibration in `given`; without one that in the folder of `session`, if there is one.
    ///
    /// # Errors
    /// If it cannot be read or is no calibration.
    pub fn of_session(given: Option<&Path>, session: &Path) -> Result<Option<Self>, Failure> {
        if let Some(given) = given {
            return Self::given(given);
        }
        let folder = open_session(session)?;
        let file = folder.path_of(RIG_CALIBRATION);
        let bytes = folder
            .read_if_there(RIG_CALIBRATION, limits::SETTINGS_BYTES)
            .map_err(|source| Failure::Read { file: file.display().to_string(), source })?;
        bytes.map(|bytes| Self::parse(bytes, file)).transpose()
    }

    /// The calibration in the bytes of `file`.
    ///
    /// # Errors
    /// If they are no calibration.
    pub fn parse(bytes: Vec<u8>, file: PathBuf) -> Result<Self, Failure> {
        let calibration = RigCalibration::parse(&String::from_utf8_lossy(&bytes), &file)?;
        Ok(Self { calibration, sha256: sha256(&bytes), file, bytes })
    }

    /// The calibration in a session with torques of up to `largest_nm`, N m.
    pub fn at_torques_up_to(self, largest_nm: f64) -> Self {
        Self { calibration: self.calibration.at_torques_up_to(largest_nm), ..self }
    }

    /// The constants that an analysis of a session with the lever `stated` uses; without a calibration those that the session states.
    ///
    /// # Errors
    /// If the calibration cannot be used for such a session.
    pub fn constants(used: Option<&Self>, stated: Option<Lever>) -> Result<RigConstants, Failure> {
        let Some(used) = used else { return Ok(RigConstants::stated(stated)) };
        RigConstants::calibrated(&used.calibration, stated)
            .map_err(|source| Failure::Calibration { file: used.file.display().to_string(), source })
    }

    /// What a diagnosis of a session with the lever `stated` knows of the rig.
    ///
    /// # Errors
    /// If the calibration cannot be used for such a session.
    pub fn knowledge(used: Option<&Self>, stated: Option<Lever>) -> Result<RigKnowledge, Failure> {
        let Some(used) = used else { return Ok(RigKnowledge::stated(stated)) };
        RigKnowledge::measured(&used.calibration, stated)
            .map_err(|source| Failure::Calibration { file: used.file.display().to_string(), source })
    }

    /// Says which calibration was used, and what is doubtful about it.
    pub fn announce(&self, console: &Console) {
        let measured = self.calibration.measured_utc.as_deref().unwrap_or("at an unknown time");
        console.announce(format_args!(
            "constants of the rig from {} (measured {measured}, SHA-256 {})",
            self.file.display(),
            &self.sha256[..8]
        ));
        self.warn(console);
    }

    /// Says what is doubtful about the calibration.
    pub fn warn(&self, console: &Console) {
        warn_of_calibration(&self.calibration, &self.file, console);
    }
}

/// Says what is doubtful about the calibration in `file`.
pub fn warn_of_calibration(calibration: &RigCalibration, file: &Path, console: &Console) {
    for warning in warnings(calibration, seconds_now()) {
        console.announce(format_args!("warning: {}: {warning}", file.display()));
    }
}

/// What is doubtful about a calibration at a time, s since 1970. A load that contradicts the others is more than doubtful: no analysis
/// takes such a calibration.
fn warnings(calibration: &RigCalibration, now_s: i64) -> Vec<String> {
    let mut found: Vec<String> = calibration.misfit_warning().into_iter().collect();
    for (field, time) in calibration.times() {
        let Some(text) = time else { continue };
        if utc_seconds(text).is_some_and(|own_s| own_s > now_s + CLOCKS_DIFFER_S) {
            found.push(format!(
                "{field} is {text}, which is later than now by the clock of this computer; is the clock, or the one of the computer \
                 that measured, right?"
            ));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_calibration_from_the_future_or_with_a_misfit_is_doubtful() {
        let mut own = RigCalibration::new("test".into(), "rig-day".into(), Vec::new(), Vec::new());
        own.measured_utc = Some("2026-11-24T10:00:00Z".into());
        let now_s = utc_seconds("2026-11-24T10:00:00Z").unwrap();
        assert_eq!(warnings(&own, now_s), Vec::<String>::new());
        let before = warnings(&own, now_s - 86_400);
        assert!(
            matches!(&before[..], [one] if one.contains("measured_utc is 2026-11-24T10:00:00Z, which is later"))
        );
        own.fit.p_value_of_misfit = Some(0.02);
        assert!(warnings(&own, now_s).is_empty());
        own.fit.p_value_of_misfit = Some(0.001);
        let misfit = warnings(&own, now_s);
        assert!(matches!(&misfit[..], [one] if one.contains("does not describe its rig trials (p = 0.001)")));
    }
}
