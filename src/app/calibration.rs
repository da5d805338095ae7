//! The calibration that an analysis uses: the one that the operator names, or the one in the session's folder.

use std::path::{Path, PathBuf};

use crate::dataset::{RIG_CALIBRATION, RigCalibration, open_session, sha256};
use crate::diagnose::RigKnowledge;
use crate::files::{self, limits};
use crate::fit::RigConstants;
use crate::wrist::Lever;

use super::console::Console;
use super::failure::Failure;

/// What stands for no calibration on the command line, though the session's folder has one.
const NONE: &str = "none";

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

    /// Says which calibration was used.
    pub fn announce(&self, console: &Console) {
        let measured = self.calibration.measured_utc.as_deref().unwrap_or("at an unknown time");
        console.announce(format_args!(
            "constants of the rig from {} (measured {measured}, SHA-256 {})",
            self.file.display(),
            &self.sha256[..8]
        ));
    }
}
