//! Across the trials: effects that leave no trace in a trial's own residual because its parameters absorb them.
//!
//! The stiffness that each trial came out with is compared among the repetitions of its condition: does it go with the place
//! in the session, the rest, the EMG ([`super::trend`])? And does any trial differ more than the spread of all allows
//! ([`super::outliers`])?

use crate::fit::{Fit, K_SRS, Observations};
use crate::statistics::{group_indices, slope_through_origin};

/// Where a stiffness still has a logarithm, N m/rad.
pub const LEAST_STIFFNESS: f64 = 1e-9;

/// The logarithms of the stiffnesses and the conditions of the trials that are looked at.
pub struct Stiffnesses {
    /// Indices of the trials.
    pub trials: Vec<usize>,
    /// The logarithm of each one's k_srs, in N m/rad.
    pub logarithms: Vec<f64>,
    /// The condition of each.
    pub conditions: Vec<usize>,
}

/// Fewest trials in excess of the conditions that a trend can be seen on.
const FEWEST_FREE: f64 = 6.0;

impl Stiffnesses {
    /// Those of `fit`, without the trials in `except`; `None` if there are too few repetitions.
    pub fn new(prepared: &Observations, fit: &Fit, except: &[usize]) -> Option<Self> {
        let trials: Vec<usize> = (0..prepared.trials.len()).filter(|t| !except.contains(t)).collect();
        let conditions: Vec<usize> = trials.iter().map(|trial| prepared.trials[*trial].condition).collect();
        let logarithm = |trial: &usize| libm::log(fit.parameters[*trial][K_SRS].max(LEAST_STIFFNESS));
        let logarithms = trials.iter().map(logarithm).collect();
        let own = Self { trials, logarithms, conditions };
        (own.freedom() >= FEWEST_FREE).then_some(own)
    }

    /// Degrees of freedom about the conditions' means.
    pub fn freedom(&self) -> f64 {
        let conditions = group_indices(self.trials.len(), |place| self.conditions[place]);
        (self.trials.len() - conditions.len()) as f64
    }

    /// The trials of the condition of the one in this place, itself among them.
    pub fn repetitions(&self, place: usize) -> impl Iterator<Item = usize> + '_ {
        (0..self.trials.len()).filter(move |other| self.conditions[*other] == self.conditions[place])
    }

    /// Values less the mean of their condition.
    pub fn centred(&self, values: &[f64]) -> Vec<f64> {
        let means = self.levels(&vec![1.0; values.len()], values);
        values.iter().zip(means).map(|(value, mean)| value - mean).collect()
    }

    /// For each trial the one factor of its condition by which `weights` come nearest to `values`.
    pub fn levels(&self, weights: &[f64], values: &[f64]) -> Vec<f64> {
        let level = |place: usize| {
            slope_through_origin(self.repetitions(place).map(|other| (weights[other], values[other])))
        };
        (0..values.len()).map(level).collect()
    }

    /// The same without the trials in `except`.
    pub fn without(&self, except: &[usize]) -> Self {
        let kept: Vec<usize> =
            (0..self.trials.len()).filter(|i| !except.contains(&self.trials[*i])).collect();
        Self {
            trials: kept.iter().map(|i| self.trials[*i]).collect(),
            logarithms: kept.iter().map(|i| self.logarithms[*i]).collect(),
            conditions: kept.iter().map(|i| self.conditions[*i]).collect(),
        }
    }
}
