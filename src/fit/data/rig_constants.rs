//! The constants of the rig by which records become angle and torque: as the session states them, or as a calibration measured them.

use serde::{Deserialize, Serialize};

use crate::dataset::{RigCalibration, RigQuantity};
use crate::signal::Section;
use crate::wrist::Lever;
use crate::wrist::mechanisms::MechanismKind;

/// Constants of a rig.
///
/// The recorded torque is `offset + gain (T + c T^3)`, late by the delay, through a first-order low-pass; the recorded angle is
/// `angle_gain theta_m`. The friction of the bearing acts on the handle, against its motion.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RigConstants {
    /// The lever; `None` for a rigid one.
    pub lever: Option<Lever>,
    /// Recorded over true torque.
    pub torque_gain: f64,
    /// Recorded torque without a load, N m.
    pub torque_offset_nm: f64,
    /// Cubic part c of the recorded torque, 1/(N m)^2.
    pub torque_nonlinearity_per_nm2: f64,
    /// Recorded over true angle.
    pub angle_gain: f64,
    /// How late the torque record is behind the angle record, s.
    pub torque_delay_s: f64,
    /// Cut-off of the torque channel's low-pass, Hz; `None` if it has none.
    pub torque_cutoff_hz: Option<f64>,
    /// Coulomb friction of the handle's bearing, N m.
    #[serde(default)]
    pub bearing_friction_nm: f64,
}

/// How the torque of a record changes with the constants by which it was made, N m: T' = scale T + shift + cubic T^3, to first order in
/// the nonlinearity.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TorqueRescaling {
    /// Factor of the torque.
    pub scale: f64,
    /// Added to it, N m.
    pub shift_nm: f64,
    /// Part of its cube that is added, 1/(N m)^2.
    pub cubic_per_nm2: f64,
}

impl TorqueRescaling {
    /// Relative change of a small torque, such as noise, on top of `torque_nm`.
    pub fn change_of_noise(&self, torque_nm: f64) -> f64 {
        self.scale - 1.0 + 3.0 * self.cubic_per_nm2 * torque_nm * torque_nm
    }
}

/// A measured constant that is further from its stated value than by this factor is a mistake of units.
const LARGEST_FACTOR: f64 = 10.0;

/// Largest part of the torque that a nonlinearity may be: beyond a third the curve is no longer a correction, and near it cannot be
/// inverted.
const LARGEST_NONLINEAR_PART: f64 = 1.0 / 3.0;

/// Newton steps to invert the cubic: each doubles the digits.
const CUBIC_STEPS: usize = 8;

/// Why a calibration cannot be used for a session.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrationMisuse {
    /// It has a lever, the session none.
    #[error(
        "the calibration is of a rig with a lever ({name} = {value}), but the session states a rigid one (rig.lever is null in \
         session.json); if it is of this rig, its handle is not rigid: write its lever into session.json; else use the calibration of \
         this rig"
    )]
    RigidSession {
        /// The constant of the lever.
        name: &'static str,
        /// Its value.
        value: f64,
    },
    /// It has no lever, the session has one.
    #[error(
        "the calibration is of a rigid lever, but the session has a compliant one (rig.lever in session.json); use the calibration of \
         this rig"
    )]
    RigidCalibration,
    /// A value that is wrong by a factor.
    #[error(
        "{name} is {value} in the calibration, {factor:.3} times the {stated} that the session states; a factor of ten or more is a \
         mistake of units (expected SI: kg m2, N m s/rad, N m/rad, N m, s, Hz)"
    )]
    Factor {
        /// The constant.
        name: &'static str,
        /// Its value.
        value: f64,
        /// The session's.
        stated: f64,
        /// Their ratio.
        factor: f64,
    },
    /// A value outside what a torque channel can have.
    #[error("{name} is {value} in the calibration; expected {low} to {high}: is it in SI units (s, Hz)?")]
    Range {
        /// The constant.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Lowest value.
        low: f64,
        /// Highest value.
        high: f64,
    },
    /// A load contradicts the others, or the rig as stated.
    #[error(
        "the calibration cannot be trusted, because a load contradicts the others or the rig: {warnings}; weigh or measure the load again, \
         correct it in the protocol and repeat the rig trials and ramphold calibrate, or analyse without: --calibration none"
    )]
    Contradictory {
        /// What the calibration warns of.
        warnings: String,
    },
}

impl Default for RigConstants {
    /// A rigid lever and perfect channels.
    fn default() -> Self {
        Self::stated(None)
    }
}

impl RigConstants {
    /// What a session with this lever states: perfect channels.
    pub fn stated(lever: Option<Lever>) -> Self {
        Self {
            lever,
            torque_gain: 1.0,
            torque_offset_nm: 0.0,
            torque_nonlinearity_per_nm2: 0.0,
            angle_gain: 1.0,
            torque_delay_s: 0.0,
            torque_cutoff_hz: None,
            bearing_friction_nm: 0.0,
        }
    }

    /// The constants that `calibration` measured, and for those that it cannot tell what a session with the lever `stated` states.
    ///
    /// # Errors
    /// If the calibration is of another kind of rig, in other units, or of a load that contradicts the others or the rig.
    pub fn calibrated(
        calibration: &RigCalibration,
        stated: Option<Lever>,
    ) -> Result<Self, CalibrationMisuse> {
        if !calibration.warnings.is_empty() {
            return Err(CalibrationMisuse::Contradictory { warnings: calibration.warnings.join("; ") });
        }
        let of_lever = [RigQuantity::LeverInertia, RigQuantity::LeverDamping, RigQuantity::LeverStiffness];
        let told = of_lever.iter().find_map(|own| Some((own.name(), calibration.value(*own)?)));
        match (stated, told) {
            (None, Some((name, value))) => return Err(CalibrationMisuse::RigidSession { name, value }),
            (Some(_), None) => {
                let states_lever = |own: &crate::dataset::CalibratedQuantity| {
                    of_lever.contains(&own.name) && own.stated.is_some()
                };
                if !calibration.quantities.iter().any(states_lever) {
                    return Err(CalibrationMisuse::RigidCalibration);
                }
            }
            _ => {}
        }
        let mut constants = Self::stated(stated);
        for quantity in Self::applied() {
            let Some(value) = calibration.value(quantity) else { continue };
            check(quantity, value, constants.value(quantity))?;
            constants.set(quantity, value);
        }
        Ok(constants)
    }

    /// The constants that enter an analysis; the bandwidth of the servo acts on what is recorded in any case.
    pub fn applied() -> [RigQuantity; 10] {
        use RigQuantity::{
            AngleGain, BearingFriction, LeverDamping, LeverInertia, LeverStiffness, TorqueCutoff,
            TorqueDelay, TorqueGain, TorqueNonlinearity, TorqueOffset,
        };
        [
            LeverInertia,
            LeverDamping,
            LeverStiffness,
            TorqueGain,
            TorqueOffset,
            TorqueNonlinearity,
            AngleGain,
            TorqueDelay,
            TorqueCutoff,
            BearingFriction,
        ]
    }

    /// A constant in the unit of its name; `None` if this rig does not have it.
    pub fn value(&self, quantity: RigQuantity) -> Option<f64> {
        match quantity {
            RigQuantity::LeverInertia => self.lever.map(|lever| lever.inertia_kg_m2),
            RigQuantity::LeverDamping => self.lever.map(|lever| lever.damping_nm_s_per_rad),
            RigQuantity::LeverStiffness => self.lever.map(|lever| lever.stiffness_nm_per_rad),
            RigQuantity::TorqueGain => Some(self.torque_gain),
            RigQuantity::TorqueOffset => Some(self.torque_offset_nm),
            RigQuantity::TorqueNonlinearity => Some(self.torque_nonlinearity_per_nm2),
            RigQuantity::AngleGain => Some(self.angle_gain),
            RigQuantity::TorqueDelay => Some(self.torque_delay_s),
            RigQuantity::TorqueCutoff => self.torque_cutoff_hz,
            RigQuantity::BearingFriction => Some(self.bearing_friction_nm),
            RigQuantity::ServoBandwidth => None,
        }
    }

    /// These constants with another value of one. A constant that this rig does not have, or that no analysis uses, is not set.
    pub fn with(mut self, quantity: RigQuantity, value: f64) -> Self {
        self.set(quantity, value);
        self
    }

    fn set(&mut self, quantity: RigQuantity, value: f64) {
        match quantity {
            RigQuantity::LeverInertia => {
                self.lever.iter_mut().for_each(|lever| lever.inertia_kg_m2 = value);
            }
            RigQuantity::LeverDamping => {
                self.lever.iter_mut().for_each(|lever| lever.damping_nm_s_per_rad = value);
            }
            RigQuantity::LeverStiffness => {
                self.lever.iter_mut().for_each(|lever| lever.stiffness_nm_per_rad = value);
            }
            RigQuantity::TorqueGain => self.torque_gain = value,
            RigQuantity::TorqueOffset => self.torque_offset_nm = value,
            RigQuantity::TorqueNonlinearity => self.torque_nonlinearity_per_nm2 = value,
            RigQuantity::AngleGain => self.angle_gain = value,
            RigQuantity::TorqueDelay => self.torque_delay_s = value,
            RigQuantity::TorqueCutoff => self.torque_cutoff_hz = Some(value),
            RigQuantity::BearingFriction => self.bearing_friction_nm = value,
            RigQuantity::ServoBandwidth => {}
        }
    }

    /// The true torque behind a recorded one, N m; delay and low-pass are in the prediction.
    pub fn true_torque_nm(&self, recorded_nm: f64) -> f64 {
        let linear = (recorded_nm - self.torque_offset_nm) / self.torque_gain;
        let cubic = self.torque_nonlinearity_per_nm2;
        if cubic == 0.0 {
            return linear;
        }
        let mut torque = linear;
        for _ in 0..CUBIC_STEPS {
            torque -=
                (torque + cubic * torque * torque * torque - linear) / (1.0 + 3.0 * cubic * torque * torque);
        }
        torque
    }

    /// Whether the nonlinearity can be taken out of a recorded torque of this size.
    pub(super) fn is_invertible_at(&self, recorded_nm: f64) -> bool {
        let linear = (recorded_nm - self.torque_offset_nm) / self.torque_gain;
        self.torque_nonlinearity_per_nm2.abs() * linear * linear < LARGEST_NONLINEAR_PART
    }

    /// How the torque of a record that these constants made changes where `other` do.
    pub fn rescaled_to(&self, other: &Self) -> TorqueRescaling {
        let scale = self.torque_gain / other.torque_gain;
        // With u = a T + d the recorded torque in the new scale, T' = u + (a c_before - a^3 c_after) T^3 to first order in c.
        let cubic = self.torque_nonlinearity_per_nm2 - scale * scale * other.torque_nonlinearity_per_nm2;
        TorqueRescaling {
            scale,
            shift_nm: (self.torque_offset_nm - other.torque_offset_nm) / other.torque_gain,
            cubic_per_nm2: scale * cubic,
        }
    }

    /// Sections that a predicted torque passes: the low-pass of the torque channel, if it has one, and the filter of the analysis.
    pub(super) fn prediction_sections(&self, filter: &[Section], period_s: f64) -> Vec<Section> {
        let low_pass = self.torque_cutoff_hz.map(|cutoff| Section::first_order_low_pass(cutoff, period_s));
        low_pass.into_iter().chain(filter.iter().copied()).collect()
    }
}

/// Checks the size of a constant against what the session states, or against what such a channel can have.
fn check(quantity: RigQuantity, value: f64, stated: Option<f64>) -> Result<(), CalibrationMisuse> {
    let name = quantity.name();
    if let Some(stated) = stated.filter(|stated| *stated > 0.0) {
        let factor = value / stated;
        if !(1.0 / LARGEST_FACTOR < factor && factor < LARGEST_FACTOR) {
            return Err(CalibrationMisuse::Factor { name, value, stated, factor });
        }
    }
    let of_mechanism = match quantity {
        RigQuantity::TorqueDelay => MechanismKind::ChannelSkew,
        RigQuantity::TorqueCutoff => MechanismKind::TorqueLag,
        RigQuantity::TorqueGain => MechanismKind::TorqueGain,
        RigQuantity::AngleGain => MechanismKind::AngleGain,
        _ => return Ok(()),
    };
    let (low, high) = (of_mechanism.parameters()[0].low, of_mechanism.parameters()[0].high);
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(CalibrationMisuse::Range { name, value, low, high })
    }
}
