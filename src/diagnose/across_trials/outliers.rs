//! Outliers: trials whose stiffness differs from that of their repetitions.

use crate::fit::{Fit, K_SRS, Observations};

/// An outlier trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the trial.
    pub trial: usize,
    /// Ratio of the stiffness to the geometric mean of the repetitions that are no outliers; `None` if there are none.
    pub ratio: Option<f64>,
}

/// How the stiffnesses of `trials` differ from those of their repetitions in `fit`.
pub fn outliers(observations: &Observations, fit: &Fit, trials: &[usize]) -> Vec<Outlier> {
    let ratio = |trial: usize| {
        let alike = |other: &usize| {
            observations.trials[*other].condition == observations.trials[trial].condition
                && !trials.contains(other)
        };
        let others: Vec<f64> = (0..observations.trials.len())
            .filter(alike)
            .map(|other| libm::log(fit.parameters[other][K_SRS]))
            .collect();
        let mean = others.iter().sum::<f64>() / others.len() as f64;
        (!others.is_empty()).then(|| fit.parameters[trial][K_SRS] / libm::exp(mean))
    };
    let mut sorted = trials.to_vec();
    sorted.sort_unstable();
    sorted.into_iter().map(|trial| Outlier { trial, ratio: ratio(trial) }).collect()
}
