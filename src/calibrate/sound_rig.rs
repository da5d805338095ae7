//! What a sound rig's constants are before they are measured, and how far measured ones are from it.
//!
//! Without a cause a constant lies about its stated value within a tolerance, as every rig is built; a cause says that it may lie anywhere
//! within the cause's prior.

use std::f64::consts::SQRT_2;

use nalgebra::{DMatrix, DVector};

use crate::dataset::{RigCalibration, RigQuantity, time_constant_s};
use crate::statistics::{HALF_INTERVAL_95, log_determinant_of_factor};
use crate::wrist::Lever;
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

/// A measured constant, in the coordinate in which its deviations are normal.
#[derive(Debug, Clone)]
pub struct ToldConstant {
    /// The cause that is about it.
    pub kind: MechanismKind,
    /// Which one.
    pub quantity: RigQuantity,
    /// Value, in the unit of the constant.
    pub value: f64,
    /// Standard error of the value.
    pub se: f64,
    /// Measured less stated, in the coordinate.
    pub deviation: f64,
    /// Change of the coordinate with the value, over a standard error.
    pub slope: f64,
    /// Standard deviation of a sound rig's deviation, in the coordinate.
    pub tolerance: f64,
    /// Mean and standard deviation of the deviation where the cause is at work.
    pub caused: (f64, f64),
    /// The same where the recorded angle is the command: the torque is then late by as much as the motor is.
    pub by_following: Option<(f64, f64)>,
}

/// The deviations of measured constants from a sound rig's.
#[derive(Debug, Clone)]
pub struct RigDeviations {
    /// The constants that a cause can be about and that were measured.
    pub told: Vec<ToldConstant>,
    /// Covariance of their deviations by the errors of the measurement.
    pub covariance: DMatrix<f64>,
    /// Upper end of the 95 % interval of the time constant of a low-pass that has no value, s. The measured delay contains it.
    pub low_pass_below_s: Option<f64>,
}

/// An error that several deviations have in common, of normal size.
#[derive(Debug, Clone)]
pub struct CommonError {
    /// Deviation by an error of one.
    pub effect: DVector<f64>,
    /// Standard deviation of the error.
    pub sd: f64,
}

impl RigDeviations {
    /// Nothing measured.
    pub fn none() -> Self {
        Self { told: Vec::new(), covariance: DMatrix::zeros(0, 0), low_pass_below_s: None }
    }

    /// The deviations that `calibration` measured from what is `stated` of a rig with this lever.
    pub fn of(
        calibration: &RigCalibration,
        lever: Option<Lever>,
        stated: impl Fn(RigQuantity) -> Option<f64>,
    ) -> Self {
        let context = ProbeContext { lever, highest_torque_nm: 0.0, window_s: 0.0 };
        let constant = |own: &CausedConstant| {
            let known = calibration.value(own.quantity).zip(calibration.se(own.quantity))?;
            told_constant(own, known, stated(own.quantity), &context)
        };
        let told: Vec<ToldConstant> = CAUSED.iter().filter_map(constant).collect();
        let covariance = DMatrix::from_fn(told.len(), told.len(), |i, j| {
            let own = calibration.covariance_between(told[i].quantity, told[j].quantity);
            own.unwrap_or(0.0) * told[i].slope * told[j].slope
        });
        let covariance = with_error_of_square(&told, covariance);
        let in_delay = told.iter().any(|own| own.quantity == RigQuantity::TorqueDelay);
        let above_hz = calibration.above(RigQuantity::TorqueCutoff).filter(|_| in_delay);
        Self { told, covariance, low_pass_below_s: above_hz.map(time_constant_s) }
    }

    /// Logarithm of the density of the deviations where each has this prior (mean and standard deviation), but for a constant; with what
    /// they have in common by `error`, its most probable size.
    pub fn log_density(
        &self,
        prior: impl Fn(&ToldConstant) -> (f64, f64),
        error: Option<&CommonError>,
    ) -> (f64, f64) {
        let mut covariance = self.covariance.clone();
        for (place, own) in self.told.iter().enumerate() {
            covariance[(place, place)] += prior(own).1 * prior(own).1;
        }
        if let Some(error) = error {
            covariance += &error.effect * error.effect.transpose() * (error.sd * error.sd);
        }
        let off =
            DVector::from_iterator(self.told.len(), self.told.iter().map(|own| own.deviation - prior(own).0));
        // Tolerances make it positive definite.
        let Some(factor) = covariance.cholesky() else { return (f64::NEG_INFINITY, 0.0) };
        let weighted = factor.solve(&off);
        let log_determinant = log_determinant_of_factor(factor.l_dirty());
        let size = error.map_or(0.0, |error| error.sd * error.sd * error.effect.dot(&weighted));
        (-0.5 * (off.dot(&weighted) + log_determinant), size)
    }
}

/// The covariance of the deviations, with which a low-pass of a time constant near zero is as likely as the trials say.
///
/// Beside a delay a low-pass acts by the square of its time constant, which has the normal error: from a time constant t of standard error
/// s to none it is t / (2 s) standard errors, and not t / s. So the time constant gets twice its error, with the sum of both as well known
/// as before.
fn with_error_of_square(told: &[ToldConstant], covariance: DMatrix<f64>) -> DMatrix<f64> {
    let place = |quantity: RigQuantity| told.iter().position(|own| own.quantity == quantity);
    let Some(lag) = place(RigQuantity::TorqueCutoff) else { return covariance };
    let mut wider = DMatrix::identity(told.len(), told.len());
    wider[(lag, lag)] = 2.0;
    if let Some(delay) = place(RigQuantity::TorqueDelay) {
        wider[(delay, lag)] = -1.0;
    }
    &wider * covariance * wider.transpose()
}

/// Number of time constants over which an unknown one is integrated, and how far they reach, in standard deviations beyond the mean.
const TIME_CONSTANTS: usize = 512;
const FARTHEST_SDS: f64 = 6.0;

impl RigDeviations {
    /// As [`RigDeviations::log_density`], where the delay contains the time constant of a low-pass of which `time_constant` is the mean and
    /// the standard deviation, s, before the trials; it is above zero.
    ///
    /// What a low-pass does beside its delay goes with the square of its time constant: that is what has a normal error in the trials.
    pub fn log_density_with_low_pass(
        &self,
        prior: impl Fn(&ToldConstant) -> (f64, f64),
        (mean, sd): (f64, f64),
    ) -> f64 {
        let Some(below_s) = self.low_pass_below_s else { return self.log_density(prior, None).0 };
        let square = |x: f64| x * x;
        let (mut weights, mut densities) = (Vec::new(), Vec::new());
        for place in 0..TIME_CONSTANTS {
            let time_constant_s = (mean + FARTHEST_SDS * sd) * (place as f64 + 0.5) / TIME_CONSTANTS as f64;
            let late = |own: &ToldConstant| {
                let (mean, sd) = prior(own);
                let is_delay = own.quantity == RigQuantity::TorqueDelay;
                (if is_delay { mean + time_constant_s } else { mean }, sd)
            };
            let seen = square(HALF_INTERVAL_95 * square(time_constant_s / below_s));
            weights.push(libm::exp(-0.5 * square((time_constant_s - mean) / sd)));
            densities.push(self.log_density(late, None).0 - 0.5 * seen);
        }
        let most = densities.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let weighted = |(weight, density): (&f64, &f64)| {
            if density.is_finite() { weight * libm::exp(density - most) } else { 0.0 }
        };
        let sum: f64 = weights.iter().zip(&densities).map(weighted).sum();
        most + libm::log(sum / weights.iter().sum::<f64>())
    }
}

/// Mean and standard deviation of the time constant of a low-pass in the torque channel, s: of one that is a cause, of a motor behind an
/// angle that is the command, or of a sound channel.
pub fn low_pass_time_constant(is_cause: bool, follows: bool) -> (f64, f64) {
    let context = ProbeContext { lever: None, highest_torque_nm: 0.0, window_s: 0.0 };
    match (MechanismKind::TorqueLag.prior(0, &context), caused_by_following(RigQuantity::TorqueCutoff)) {
        (Prior::LogNormal { median, log_sd }, _) if is_cause => {
            (time_constant_s(median), time_constant_s(median) * log_sd)
        }
        (_, Some(by_following)) if follows => by_following,
        _ => (0.0, SOUND_DELAY_S),
    }
}

/// Median and standard deviation of the logarithm of a servo's bandwidth, Hz.
pub fn servo_bandwidth_hz() -> (f64, f64) {
    let context = ProbeContext { lever: None, highest_torque_nm: 0.0, window_s: 0.0 };
    match MechanismKind::ServoFollowing.prior(0, &context) {
        Prior::LogNormal { median, log_sd } => (median, log_sd),
        Prior::Normal { .. } | Prior::HalfNormal { .. } => unreachable!("a bandwidth is positive"),
    }
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

/// A measured constant in its coordinate; `None` if the session states nothing to compare with.
fn told_constant(
    own: &CausedConstant,
    (value, se): (f64, f64),
    stated: Option<f64>,
    context: &ProbeContext,
) -> Option<ToldConstant> {
    let prior = own.kind.prior(0, context);
    let by_error = own.quantity.normal_error(value, se) / se;
    let (deviation, slope, caused) = match (own.quantity, prior) {
        (RigQuantity::TorqueCutoff, Prior::LogNormal { median, log_sd }) => {
            let typical = time_constant_s(median);
            (time_constant_s(value), by_error, (typical, typical * log_sd))
        }
        (RigQuantity::TorqueDelay, Prior::Normal { mean, sd }) => (value, 1.0, (mean, sd)),
        // A measured damping may be zero or less, which has no logarithm.
        (RigQuantity::LeverDamping, Prior::LogNormal { log_sd, .. }) => {
            let stated = stated.filter(|stated| *stated > 0.0)?;
            (value / stated - 1.0, 1.0 / stated, (0.0, log_sd))
        }
        (_, Prior::LogNormal { log_sd, .. }) => {
            let stated = stated.filter(|stated| *stated > 0.0)?;
            (libm::log(value / stated), by_error, (0.0, log_sd))
        }
        _ => return None,
    };
    let (kind, quantity, tolerance) = (own.kind, own.quantity, own.tolerance);
    let by_following = caused_by_following(quantity);
    Some(ToldConstant { kind, quantity, value, se, deviation, slope, tolerance, caused, by_following })
}
