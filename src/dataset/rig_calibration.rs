//! The file of a rig's measured constants, `rig-calibration.json`: what `calibrate` writes, and `run`, `fit` and `diagnose` take.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::disk::Disk;
use super::recorder::RecordError;
use crate::files::Folder;
use crate::json_file::{self, JsonFileError};
use crate::wrist::Lever;

/// Name of the file.
pub const RIG_CALIBRATION: &str = "rig-calibration.json";

/// Format and version of the file.
pub const RIG_CALIBRATION_FORMAT: &str = "ramphold-rig-calibration/1";

/// What the file should be, for messages.
const A_CALIBRATION: &str = "a rig calibration, as ramphold calibrate writes it";

/// A constant of the rig that can be measured without a person.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub enum RigQuantity {
    /// I_l, kg m2.
    #[serde(rename = "lever_inertia_kg_m2")]
    LeverInertia,
    /// b_l, N m s/rad.
    #[serde(rename = "lever_damping_nm_s_per_rad")]
    LeverDamping,
    /// k_l, N m/rad.
    #[serde(rename = "lever_stiffness_nm_per_rad")]
    LeverStiffness,
    /// Recorded over true torque.
    #[serde(rename = "torque_gain")]
    TorqueGain,
    /// Recorded torque without a load, N m.
    #[serde(rename = "torque_offset_nm")]
    TorqueOffset,
    /// Cubic part of the recorded torque, c in gain (T + c T^3), 1/(N m)^2.
    #[serde(rename = "torque_nonlinearity_per_nm2")]
    TorqueNonlinearity,
    /// Recorded over true angle.
    #[serde(rename = "angle_gain")]
    AngleGain,
    /// How late the torque record is behind the angle record, s.
    #[serde(rename = "torque_delay_s")]
    TorqueDelay,
    /// Cut-off of the torque channel's first-order low-pass, Hz.
    #[serde(rename = "torque_cutoff_hz")]
    TorqueCutoff,
    /// Natural frequency with which the motor follows its target, Hz.
    #[serde(rename = "servo_bandwidth_hz")]
    ServoBandwidth,
    /// Coulomb friction of the handle's bearing, N m.
    #[serde(rename = "bearing_friction_nm")]
    BearingFriction,
}

impl RigQuantity {
    /// All of them, in the order of the file.
    pub const ALL: [Self; 11] = [
        Self::LeverInertia,
        Self::LeverDamping,
        Self::LeverStiffness,
        Self::TorqueGain,
        Self::TorqueOffset,
        Self::TorqueNonlinearity,
        Self::AngleGain,
        Self::TorqueDelay,
        Self::TorqueCutoff,
        Self::ServoBandwidth,
        Self::BearingFriction,
    ];

    /// The constant with this name in the file.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|own| own.name() == name)
    }

    /// Name in the file, with the unit.
    pub fn name(self) -> &'static str {
        match self {
            Self::LeverInertia => "lever_inertia_kg_m2",
            Self::LeverDamping => "lever_damping_nm_s_per_rad",
            Self::LeverStiffness => "lever_stiffness_nm_per_rad",
            Self::TorqueGain => "torque_gain",
            Self::TorqueOffset => "torque_offset_nm",
            Self::TorqueNonlinearity => "torque_nonlinearity_per_nm2",
            Self::AngleGain => "angle_gain",
            Self::TorqueDelay => "torque_delay_s",
            Self::TorqueCutoff => "torque_cutoff_hz",
            Self::ServoBandwidth => "servo_bandwidth_hz",
            Self::BearingFriction => "bearing_friction_nm",
        }
    }

    /// Whether it is a frequency above which the rig does not follow.
    pub fn is_frequency(self) -> bool {
        matches!(self, Self::TorqueCutoff | Self::ServoBandwidth)
    }

    /// Whether no rig has a value of zero or less.
    pub fn is_positive(self) -> bool {
        matches!(
            self,
            Self::LeverInertia
                | Self::LeverStiffness
                | Self::TorqueGain
                | Self::AngleGain
                | Self::TorqueCutoff
                | Self::ServoBandwidth
        )
    }
}

/// What is known of one constant of the rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibratedQuantity {
    /// Which constant.
    pub name: RigQuantity,
    /// Its value, in the unit of the name; `None` if the loads cannot tell it.
    pub value: Option<f64>,
    /// Its standard error, in the same unit.
    pub se: Option<f64>,
    /// The value that the session states or assumes, if it does.
    #[serde(default)]
    pub stated: Option<f64>,
    /// Why there is no value.
    #[serde(default)]
    pub reason: Option<String>,
    /// Of a frequency without a value: it lies above this one (95 %), if the rig has such a limit at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub above: Option<f64>,
}

/// A file that the calibration was made from.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationSource {
    /// Path in the session's folder, with `/`.
    pub file: String,
    /// SHA-256, in hexadecimal digits.
    pub sha256: String,
}

/// A load that the calibration rests on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationLoad {
    /// Its kind: `empty_handle`, `known_weight`, `known_inertia`, `clamped_handle` or `known_spring`.
    pub load: String,
    /// Mass of a weight, kg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mass_kg: Option<f64>,
    /// Lever arm of a weight, m.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arm_m: Option<f64>,
    /// Inertia of a bar, kg m2.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub inertia_kg_m2: Option<f64>,
    /// Stiffness of a spring, N m/rad.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stiffness_nm_per_rad: Option<f64>,
    /// Standard deviation of the stated value, as a part of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub relative_error: Option<f64>,
    /// Number of trials with it.
    pub trials: usize,
}

/// Noise of the torque channel with the motor at rest.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationNoise {
    /// Standard deviation, N m.
    pub torque_nm: f64,
    /// Its spectrum, one-sided.
    pub spectrum: NoiseSpectrum,
}

/// A one-sided spectrum of power.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseSpectrum {
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// Power at each, (N m)^2/Hz.
    pub power_nm2_per_hz: Vec<f64>,
}

/// How well the rig's model describes the rig trials.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CalibrationFit {
    /// Number of samples.
    pub samples: usize,
    /// Probability of residuals this large if the model is right; `None` if the trials are too few to tell.
    pub p_value_of_misfit: Option<f64>,
}

/// How far the recorded angle is from the target in the ramps of the empty handle. A drive may report the target as the motor's angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AngleAgainstTarget {
    /// Largest difference, in steps of the encoder, or in six standard deviations of the angle at rest if these are larger.
    pub largest_steps: f64,
    /// Largest difference over the largest speed of the target: how long the motor needs for it, s.
    pub largest_s: f64,
    /// Sample period, s.
    pub sample_s: f64,
}

/// Largest difference of two angles of which each is rounded and relative to a rounded start, in steps.
pub const ROUNDING_STEPS: f64 = 2.0;

impl AngleAgainstTarget {
    /// Whether the recorded angle cannot be told from the target, by steps that the target passes within a sample. Coarser ones hide how
    /// a motor follows.
    pub fn is_target(&self) -> bool {
        self.largest_steps <= ROUNDING_STEPS && self.step_s() <= self.sample_s
    }

    /// Time for a step at the largest speed of the target, s.
    pub fn step_s(&self) -> f64 {
        self.largest_s / self.largest_steps.max(f64::MIN_POSITIVE)
    }
}

/// The measured constants of a rig, with their joint covariance.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigCalibration {
    pub(super) format: String,
    /// When it was made, UTC.
    #[serde(default)]
    pub made_utc: Option<String>,
    /// When the rig trials were measured, UTC.
    #[serde(default)]
    pub measured_utc: Option<String>,
    /// Program and build that made it.
    pub program: String,
    /// Name of the session's folder.
    pub session: String,
    /// The files that it was made from.
    pub sources: Vec<CalibrationSource>,
    /// The loads.
    pub loads: Vec<CalibrationLoad>,
    /// What is known of each constant, in the order of [`RigQuantity::ALL`].
    pub quantities: Vec<CalibratedQuantity>,
    /// The constants that have a value, in the order of the covariance.
    pub covariance_of: Vec<RigQuantity>,
    /// Their joint covariance, one row for each.
    pub covariance: Vec<Vec<f64>>,
    /// Noise of the torque channel.
    pub noise: CalibrationNoise,
    /// How well the model fits.
    pub fit: CalibrationFit,
    /// How far the recorded angle is from the target; `None` where nobody looked.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub angle_against_target: Option<AngleAgainstTarget>,
    /// Loads whose stated value disagrees with the other loads, as sentences.
    #[serde(default)]
    pub warnings: Vec<String>,
}

/// Why a file is no rig calibration.
#[derive(Debug, thiserror::Error)]
pub enum RigCalibrationError {
    /// It cannot be read, is not JSON, or a field is missing, unknown or of the wrong type.
    #[error(transparent)]
    Json(#[from] JsonFileError),
    /// A value that a calibration cannot have.
    #[error("{}, field {field}: {message}; make it anew with ramphold calibrate", .file.display())]
    Value {
        /// The file.
        file: PathBuf,
        /// Path of the field.
        field: String,
        /// What is wrong and what was expected.
        message: String,
    },
}

impl RigCalibration {
    /// A calibration of `quantities` with the `covariance` of those that have a value; no sources, loads and noise yet.
    pub fn new(
        program: String,
        session: String,
        quantities: Vec<CalibratedQuantity>,
        covariance: Vec<Vec<f64>>,
    ) -> Self {
        Self {
            format: RIG_CALIBRATION_FORMAT.to_owned(),
            made_utc: None,
            measured_utc: None,
            program,
            session,
            sources: Vec::new(),
            loads: Vec::new(),
            covariance_of: told(&quantities),
            quantities,
            covariance,
            noise: CalibrationNoise::default(),
            fit: CalibrationFit::default(),
            angle_against_target: None,
            warnings: Vec::new(),
        }
    }

    /// Reads and checks a file.
    ///
    /// # Errors
    /// If it cannot be read or is no rig calibration.
    pub fn read(file: &Path) -> Result<Self, RigCalibrationError> {
        Self::parse(&json_file::read_text(file, A_CALIBRATION)?, file)
    }

    /// Parses and checks the text of a file; `file` is its name for messages.
    ///
    /// # Errors
    /// If it is not JSON, or its values contradict each other.
    pub fn parse(text: &str, file: &Path) -> Result<Self, RigCalibrationError> {
        let read: Self = json_file::parse(text, file, A_CALIBRATION)?;
        read.check().map_err(|(field, message)| RigCalibrationError::Value {
            file: file.to_owned(),
            field,
            message,
        })?;
        Ok(read)
    }

    /// Writes it into `folder`; a file of that name is replaced.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        self.write_as(disk, &folder.join(RIG_CALIBRATION))
    }

    /// Writes it as `file`; a file of that name is replaced.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write_as(&self, disk: &Disk, file: &Path) -> Result<(), RecordError> {
        let name = file.file_name().unwrap_or_default().to_string_lossy();
        let write =
            || disk.write(&Folder::open(file.parent().unwrap_or(Path::new("")))?, &*name, &self.text());
        write().map_err(RecordError::at(file))
    }

    /// Its times, by the name of the field.
    pub fn times(&self) -> [(&'static str, Option<&str>); 2] {
        [("made_utc", self.made_utc.as_deref()), ("measured_utc", self.measured_utc.as_deref())]
    }

    /// The bytes of the file.
    pub fn text(&self) -> Vec<u8> {
        json_file::pretty(self).into_bytes()
    }

    /// Value of a constant, in the unit of its name; `None` if the loads could not tell it.
    pub fn value(&self, quantity: RigQuantity) -> Option<f64> {
        self.quantities.iter().find(|known| known.name == quantity)?.value
    }

    /// Standard error of a constant.
    pub fn se(&self, quantity: RigQuantity) -> Option<f64> {
        self.quantities.iter().find(|known| known.name == quantity)?.se
    }

    /// What a frequency without a value lies above (95 %), Hz, if the loads tell so much.
    pub fn above(&self, quantity: RigQuantity) -> Option<f64> {
        self.quantities.iter().find(|known| known.name == quantity)?.above
    }

    /// Covariance of two constants; `None` if one of them has no value.
    pub fn covariance_between(&self, one: RigQuantity, other: RigQuantity) -> Option<f64> {
        let place = |wanted| self.covariance_of.iter().position(|quantity| *quantity == wanted);
        Some(self.covariance[place(one)?][place(other)?])
    }

    /// The lever with the measured constants in the place of those of `stated`.
    pub fn lever(&self, stated: Lever) -> Lever {
        Lever {
            inertia_kg_m2: self.value(RigQuantity::LeverInertia).unwrap_or(stated.inertia_kg_m2),
            damping_nm_s_per_rad: self
                .value(RigQuantity::LeverDamping)
                .unwrap_or(stated.damping_nm_s_per_rad),
            stiffness_nm_per_rad: self
                .value(RigQuantity::LeverStiffness)
                .unwrap_or(stated.stiffness_nm_per_rad),
        }
    }
}

/// The constants that have a value.
pub(super) fn told(quantities: &[CalibratedQuantity]) -> Vec<RigQuantity> {
    quantities.iter().filter(|quantity| quantity.value.is_some()).map(|quantity| quantity.name).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_names_in_the_file_are_those_in_the_program() {
        for quantity in RigQuantity::ALL {
            assert_eq!(RigQuantity::named(quantity.name()), Some(quantity));
            assert_eq!(serde_json::to_value(quantity).unwrap(), quantity.name());
        }
    }
}
