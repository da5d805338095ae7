//! How far a rig's measured constants are from a sound rig's.

use nalgebra::{DMatrix, DVector};

use super::sound_rig::{CAUSED, CausedConstant, ConstantPriors, RigFaults};
use crate::dataset::{RigCalibration, RigQuantity, time_constant_s};
use crate::statistics::{HALF_INTERVAL_95, log_determinant_of_factor, probabilities};
use crate::wrist::mechanisms::MechanismKind;

/// A measured constant, in the coordinate in which its deviations are normal: the logarithm of its ratio to the stated value, the ratio
/// less one of a damping, seconds of a delay and of the time constant of a low-pass.
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
    /// What is known of the deviation before it is measured.
    pub priors: ConstantPriors,
}

/// The deviations of measured constants from a sound rig's.
#[derive(Debug, Clone)]
pub struct RigDeviations {
    /// The constants that a cause can be about and that were measured.
    pub told: Vec<ToldConstant>,
    /// Covariance of their deviations by the errors of the measurement.
    pub covariance: DMatrix<f64>,
    /// A low-pass that has no value.
    pub hidden_low_pass: Option<HiddenLowPass>,
}

/// A low-pass of the torque channel that has no value: the measured delay contains its time constant.
#[derive(Debug, Clone, Copy)]
pub struct HiddenLowPass {
    /// Upper end of the 95 % interval of the time constant, s.
    below_s: f64,
    priors: ConstantPriors,
}

/// An error that several deviations have in common, of normal size.
#[derive(Debug, Clone)]
pub struct CommonError {
    /// Deviation by an error of one.
    pub effect: DVector<f64>,
    /// Standard deviation of the error.
    pub sd: f64,
}

/// How well deviations agree with a rig.
#[derive(Debug, Clone, Copy)]
pub struct Agreement {
    /// Logarithm of their density, but for a constant.
    pub log_density: f64,
    /// Most probable size of the common error.
    pub error: f64,
}

/// Number of time constants over which an unknown one is integrated, and how far they reach, in standard deviations beyond the mean.
const TIME_CONSTANTS: usize = 512;
const FARTHEST_SDS: f64 = 6.0;

impl HiddenLowPass {
    /// Time constants, s, that a low-pass may have in a rig with these faults, with the logarithm of the weight of each before the delay is
    /// looked at. The weights of the prior add up to one.
    ///
    /// What a low-pass does beside its delay goes with the square of its time constant: that is what has a normal error in the trials.
    fn time_constants(&self, faults: RigFaults<'_>) -> Vec<(f64, f64)> {
        let square = |x: f64| x * x;
        let (mean, sd) = self.priors.with(faults);
        let step_s = (mean + FARTHEST_SDS * sd) / TIME_CONSTANTS as f64;
        let all: Vec<f64> = (0..TIME_CONSTANTS).map(|place| step_s * (place as f64 + 0.5)).collect();
        let of_prior: Vec<f64> = all.iter().map(|own| -0.5 * square((own - mean) / sd)).collect();
        let (_, log_sum) = probabilities(&of_prior);
        let seen = |own: f64| -0.5 * square(HALF_INTERVAL_95 * square(own / self.below_s));
        all.iter().zip(&of_prior).map(|(own, log_weight)| (*own, log_weight - log_sum + seen(*own))).collect()
    }
}

impl RigDeviations {
    /// Nothing measured.
    pub fn none() -> Self {
        Self { told: Vec::new(), covariance: DMatrix::zeros(0, 0), hidden_low_pass: None }
    }

    /// The deviations that `calibration` measured from what is `stated` of the rig.
    pub fn of(calibration: &RigCalibration, stated: impl Fn(RigQuantity) -> Option<f64>) -> Self {
        let constant = |own: &CausedConstant| {
            let known = calibration.value(own.quantity).zip(calibration.se(own.quantity))?;
            told_constant(own, known, stated(own.quantity))
        };
        let told: Vec<ToldConstant> = CAUSED.iter().filter_map(constant).collect();
        let covariance = DMatrix::from_fn(told.len(), told.len(), |i, j| {
            let own = calibration.covariance_between(told[i].quantity, told[j].quantity);
            own.unwrap_or(0.0) * told[i].slope * told[j].slope
        });
        let covariance = with_error_of_square(&told, covariance);
        let has_delay = told.iter().any(|own| own.quantity == RigQuantity::TorqueDelay);
        let low_pass = CAUSED.iter().find(|own| own.quantity == RigQuantity::TorqueCutoff);
        let hidden = calibration.above(RigQuantity::TorqueCutoff).filter(|_| has_delay).zip(low_pass);
        let hidden_low_pass = hidden.map(|(above_hz, own)| HiddenLowPass {
            below_s: time_constant_s(above_hz),
            priors: own.priors(),
        });
        Self { told, covariance, hidden_low_pass }
    }

    /// The causes whose constants the deviations tell something of.
    pub fn kinds(&self) -> impl Iterator<Item = MechanismKind> {
        let low_pass = self.hidden_low_pass.map(|_| MechanismKind::TorqueLag);
        self.told.iter().map(|own| own.kind).chain(low_pass)
    }

    /// How well the deviations agree with a rig of these faults, where they have `error` in common.
    pub fn agreement(&self, faults: RigFaults<'_>, error: Option<&CommonError>) -> Agreement {
        let mut covariance = self.covariance.clone();
        for (place, own) in self.told.iter().enumerate() {
            let (_, sd) = own.priors.with(faults);
            covariance[(place, place)] += sd * sd;
        }
        if let Some(error) = error {
            covariance += &error.effect * error.effect.transpose() * (error.sd * error.sd);
        }
        // Tolerances make it positive definite.
        let Some(factor) = covariance.cholesky() else {
            return Agreement { log_density: f64::NEG_INFINITY, error: 0.0 };
        };
        let log_determinant = log_determinant_of_factor(factor.l_dirty());
        let with_low_pass = |time_constant_s: f64| {
            let off = self.told.iter().map(|own| {
                let is_delay = own.quantity == RigQuantity::TorqueDelay;
                own.deviation - own.priors.with(faults).0 - if is_delay { time_constant_s } else { 0.0 }
            });
            let off = DVector::from_iterator(self.told.len(), off);
            let weighted = factor.solve(&off);
            let error = error.map_or(0.0, |error| error.sd * error.sd * error.effect.dot(&weighted));
            Agreement { log_density: -0.5 * (off.dot(&weighted) + log_determinant), error }
        };
        let Some(low_pass) = self.hidden_low_pass else { return with_low_pass(0.0) };
        let weighed = low_pass.time_constants(faults).into_iter().map(|(time_constant_s, log_weight)| {
            let own = with_low_pass(time_constant_s);
            (own.log_density + log_weight, own.error)
        });
        let (log_weights, errors): (Vec<f64>, Vec<f64>) = weighed.unzip();
        let (found, log_density) = probabilities(&log_weights);
        Agreement { log_density, error: found.iter().zip(&errors).map(|(own, error)| own * error).sum() }
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

/// A measured constant in its coordinate; `None` if the session states nothing to compare with.
fn told_constant(own: &CausedConstant, (value, se): (f64, f64), stated: Option<f64>) -> Option<ToldConstant> {
    let by_error = own.quantity.normal_error(value, se) / se;
    let stated = stated.filter(|stated| *stated > 0.0);
    let (deviation, slope) = match own.quantity {
        RigQuantity::TorqueCutoff => (time_constant_s(value), by_error),
        RigQuantity::TorqueDelay => (value, 1.0),
        // A measured damping may be zero or less, which has no logarithm.
        RigQuantity::LeverDamping => (value / stated? - 1.0, 1.0 / stated?),
        _ => (libm::log(value / stated?), by_error),
    };
    let (kind, quantity, priors) = (own.kind, own.quantity, own.priors());
    Some(ToldConstant { kind, quantity, value, se, deviation, slope, priors })
}
