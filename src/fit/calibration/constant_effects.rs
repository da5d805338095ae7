//! How the errors of a calibration reach the estimates: G C G', with G the change of the estimates per change of the constants.
//!
//! An error of a constant is common to all trials of a session, so it does not shrink with repetitions.

use rayon::prelude::*;

use super::asked_fit::AskedFit;
use crate::dataset::{RigCalibration, RigQuantity};
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::wrist::BASE_PARAMETERS;

/// Relative change of the six base parameters of every trial.
pub type TrialChanges = Vec<[f64; 6]>;

/// What the errors of the measured constants do to the base parameters of every trial.
#[derive(Debug, Clone)]
pub struct ConstantEffects {
    /// The constants.
    pub quantities: Vec<RigQuantity>,
    /// For each constant, the relative change of the parameters by one standard error of the constant.
    pub per_se: Vec<TrialChanges>,
    /// Correlation of the errors of the constants.
    correlation: Vec<Vec<f64>>,
}

impl ConstantEffects {
    /// Effects on `fit`, by fits to the session with each constant one standard error smaller and larger: a trial whose elastic limit is
    /// hardly determined does not follow the Gauss-Newton matrix of its optimum that far. `None` if the session has no such fit.
    pub fn new(observations: &Observations, fit: AskedFit, calibration: &RigCalibration) -> Option<Self> {
        let constants = observations.constants;
        let known = calibration.covariance_of.iter().filter(|own| constants.value(**own).is_some());
        let quantities: Vec<RigQuantity> = known.copied().collect();
        let se = |quantity: RigQuantity| calibration.se(quantity).unwrap_or(0.0);
        let per_se = |quantity: &RigQuantity| {
            let value = constants.value(*quantity).unwrap_or(0.0);
            let at = |errors: f64| {
                let off = quantity.off_by(value, se(*quantity), errors);
                fit.refitted_to(&observations.with_constants(constants.with(*quantity, off)))
            };
            Some(half_differences(&at(-1.0)?, &at(1.0)?))
        };
        let correlation = |one: &RigQuantity| {
            let of = |other: &RigQuantity| {
                let covariance = calibration.covariance_between(*one, *other).unwrap_or(0.0);
                // An error of zero goes with no other one.
                if covariance == 0.0 { 0.0 } else { covariance / (se(*one) * se(*other)) }
            };
            quantities.iter().map(of).collect()
        };
        Some(Self {
            per_se: quantities.par_iter().map(per_se).collect::<Option<_>>()?,
            correlation: quantities.iter().map(correlation).collect(),
            quantities,
        })
    }

    /// Covariance that the errors of the constants give to the logarithms of a base parameter in two trials.
    pub fn log_covariance(&self, parameter: usize, one: usize, other: usize) -> f64 {
        let all = self.per_se.iter().zip(&self.correlation);
        all.map(|(changes, correlation)| {
            let others = self.per_se.iter().zip(correlation);
            let with = others.map(|(own, correlation)| correlation * own[other][parameter]).sum::<f64>();
            changes[one][parameter] * with
        })
        .sum()
    }

    /// Standard error of a parameter of a trial from the constants alone, relative to the parameter; `None` if it is no finite number.
    pub fn se(&self, parameter: usize, trial: usize) -> Option<f64> {
        let variance = self.log_covariance(parameter, trial, trial);
        // Rounding may leave less than zero.
        variance.is_finite().then(|| libm::sqrt(variance.max(0.0)))
    }
}

/// Half of the relative differences between the base parameters of two fits to the same trials.
fn half_differences(low: &Fit, high: &Fit) -> TrialChanges {
    let of_trial = |(low, high): (&Vec<f64>, &Vec<f64>)| {
        std::array::from_fn::<_, { BASE_PARAMETERS.len() }, _>(|parameter| {
            // A parameter that a model file holds at zero does not change.
            if high[parameter] == low[parameter] {
                return 0.0;
            }
            0.5 * libm::log(high[parameter] / low[parameter])
        })
    };
    low.parameters.iter().zip(&high.parameters).map(of_trial).collect()
}
