//! What the constants of a rig are before they are measured.
//!
//! Without a cause a constant lies about its stated value within a tolerance, as every rig is built; a cause says that it may lie anywhere
//! within the cause's prior.

use std::f64::consts::SQRT_2;

use crate::dataset::{RigQuantity, time_constant_s};
use crate::wrist::mechanisms::{MechanismKind, Prior, ProbeContext};

/// A constant that a cause can be about.
pub struct CausedConstant {
    /// The cause.
    pub kind: MechanismKind,
    /// The constant.
    pub quantity: RigQuantity,
    /// Standard deviation of a sound rig's constant about its stated value: as a part of it, or in seconds of a delay and of the time
    /// constant of a low-pass. Declared in docs/explanation/diagnosis.md.
    pub tolerance: f64,
}

/// Standard deviation of a sound rig's delay between its channels, and of the time constant of its torque channel, s.
pub const SOUND_DELAY_S: f64 = 1e-4;

/// The constants that causes are about, with what is within the tolerance of a sound rig.
pub const CAUSED: [CausedConstant; 7] = [
    caused(MechanismKind::LeverInertia, RigQuantity::LeverInertia, 0.03),
    caused(MechanismKind::LeverDamping, RigQuantity::LeverDamping, 0.05),
    caused(MechanismKind::LeverStiffness, RigQuantity::LeverStiffness, 0.03),
    caused(MechanismKind::TorqueGain, RigQuantity::TorqueGain, 0.01),
    caused(MechanismKind::AngleGain, RigQuantity::AngleGain, 0.005),
    caused(MechanismKind::ChannelSkew, RigQuantity::TorqueDelay, SOUND_DELAY_S),
    caused(MechanismKind::TorqueLag, RigQuantity::TorqueCutoff, SOUND_DELAY_S),
];

const fn caused(kind: MechanismKind, quantity: RigQuantity, tolerance: f64) -> CausedConstant {
    CausedConstant { kind, quantity, tolerance }
}

/// What is wrong with a rig.
#[derive(Debug, Clone, Copy, Default)]
pub struct RigFaults<'a> {
    /// The causes at work.
    pub causes: &'a [MechanismKind],
    /// Whether the recorded angle is the command: the torque is then late by as much as the motor is.
    pub angle_is_command: bool,
}

/// Mean and standard deviation of a constant's deviation from its stated value, before it is measured, in the coordinate of
/// [`ToldConstant`](super::rig_deviations::ToldConstant).
pub type Expected = (f64, f64);

/// What is known of a constant before it is measured.
#[derive(Debug, Clone, Copy)]
pub struct ConstantPriors {
    kind: MechanismKind,
    /// In a sound rig.
    pub sound: Expected,
    caused: Expected,
    by_following: Option<Expected>,
}

impl ConstantPriors {
    /// In a rig with these faults.
    pub fn with(&self, faults: RigFaults<'_>) -> Expected {
        match self.by_following {
            _ if faults.causes.contains(&self.kind) => self.caused,
            Some(by_following) if faults.angle_is_command => by_following,
            _ => self.sound,
        }
    }

    /// Whether a motor behind its command changes the constant.
    pub fn has_motor_delay(&self) -> bool {
        self.by_following.is_some()
    }
}

impl CausedConstant {
    /// What is known of the constant before it is measured.
    pub fn priors(&self) -> ConstantPriors {
        let caused = match (self.quantity, prior_of(self.kind)) {
            (RigQuantity::TorqueCutoff, Prior::LogNormal { median, log_sd }) => {
                (time_constant_s(median), time_constant_s(median) * log_sd)
            }
            (_, Prior::LogNormal { log_sd, .. }) => (0.0, log_sd),
            (_, Prior::Normal { mean, sd }) => (mean, sd),
            (_, Prior::HalfNormal { .. }) => unreachable!("a constant deviates to both sides"),
        };
        let by_following = caused_by_following(self.quantity);
        ConstantPriors { kind: self.kind, sound: (0.0, self.tolerance), caused, by_following }
    }
}

/// Median and standard deviation of the logarithm of a servo's bandwidth, Hz.
pub fn servo_bandwidth_hz() -> (f64, f64) {
    match prior_of(MechanismKind::ServoFollowing) {
        Prior::LogNormal { median, log_sd } => (median, log_sd),
        Prior::Normal { .. } | Prior::HalfNormal { .. } => unreachable!("a bandwidth is positive"),
    }
}

/// The prior of a cause's first parameter, whose spread does not depend on the session.
fn prior_of(kind: MechanismKind) -> Prior {
    kind.prior(0, &ProbeContext { lever: None, highest_torque_nm: 0.0, window_s: 0.0 })
}

/// Mean and standard deviation of what a motor's delay does to a constant of the torque channel, where the recorded angle is the command.
/// Two equal poles of time constant T are, in mean and variance, a delay of (2 - sqrt 2) T and a pole of sqrt 2 T. Servos that brake less,
/// or more, lie about them by T (assumed).
fn caused_by_following(quantity: RigQuantity) -> Option<(f64, f64)> {
    let time_constant_s = time_constant_s(servo_bandwidth_hz().0);
    match quantity {
        RigQuantity::TorqueDelay => Some(((2.0 - SQRT_2) * time_constant_s, time_constant_s)),
        RigQuantity::TorqueCutoff => Some((SQRT_2 * time_constant_s, time_constant_s)),
        _ => None,
    }
}
