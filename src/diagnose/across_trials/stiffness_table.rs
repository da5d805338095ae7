//! Fitted stiffnesses of the trials, for effects that a trial's own parameters absorb and its residual does not show.
//!
//! The stiffness of each trial is compared with those of the repetitions of its condition: does it depend on the position in the
//! session, the rest before or the EMG (`covariate_regression`), and does a single trial differ more than the spread of all allows
//! (`outliers`)?

use crate::fit::{Fit, K_SRS, Observations};
use crate::statistics::{group_indices, slope_through_origin};

/// Lower bound of a stiffness before its logarithm is taken, N m/rad.
pub const MIN_STIFFNESS_NM_PER_RAD: f64 = 1e-9;

/// Logarithms of the stiffnesses and conditions of the analysed trials.
pub struct StiffnessTable {
    /// Indices of the trials.
    pub trials: Vec<usize>,
    /// Logarithm of k_srs (in N m/rad) of each trial.
    pub logarithms: Vec<f64>,
    /// Condition index of each trial.
    pub conditions: Vec<usize>,
}

/// Smallest number of trials in excess of the number of conditions with which trials are compared.
pub const MIN_DEGREES_OF_FREEDOM: f64 = 6.0;

impl StiffnessTable {
    /// The stiffnesses of `fit`, without the trials in `except`; `None` with too few repetitions.
    pub fn new(observations: &Observations, fit: &Fit, except: &[usize]) -> Option<Self> {
        let trials: Vec<usize> = (0..observations.trials.len()).filter(|t| !except.contains(t)).collect();
        let conditions: Vec<usize> =
            trials.iter().map(|trial| observations.trials[*trial].condition).collect();
        let logarithm =
            |trial: &usize| libm::log(fit.parameters[*trial][K_SRS].max(MIN_STIFFNESS_NM_PER_RAD));
        let logarithms = trials.iter().map(logarithm).collect();
        let own = Self { trials, logarithms, conditions };
        (own.freedom() >= MIN_DEGREES_OF_FREEDOM).then_some(own)
    }

    /// Degrees of freedom about the means of the conditions.
    pub fn freedom(&self) -> f64 {
        let conditions = group_indices(self.trials.len(), |place| self.conditions[place]);
        (self.trials.len() - conditions.len()) as f64
    }

    /// Places of the trials of the same condition as the trial at `place`, itself included.
    pub fn repetitions(&self, place: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.trials.len()).filter(move |other| self.conditions[*other] == self.conditions[place])
    }

    /// `values` less the mean of their condition.
    pub fn centred(&self, values: &[f64]) -> Vec<f64> {
        let means = self.levels(&vec![1.0; values.len()], values);
        values.iter().zip(means).map(|(value, mean)| value - mean).collect()
    }

    /// For each trial the least-squares factor of its condition: the c that minimises the sum of (values - c weights)^2.
    pub fn levels(&self, weights: &[f64], values: &[f64]) -> Vec<f64> {
        let level = |place: usize| {
            slope_through_origin(self.repetitions(place).map(|other| (weights[other], values[other])))
        };
        (0..values.len()).map(level).collect()
    }
}
