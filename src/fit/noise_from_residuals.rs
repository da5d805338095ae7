//! Noise covariance from the residuals of a fit, for sessions without holds.

use crate::fit::data::observations::{NoiseSource, Observations};
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::predictions;
use crate::fit::model::specification::Model;
use crate::fit::residuals::objective::Weighting;
use crate::signal::NoiseCovariance;

/// Fraction of the mean variance that replaces what the parameters of the trials absorbed of the noise.
const ABSORBED_FRACTION: f64 = 0.05;

impl Observations {
    /// Estimates the noise covariance from the deviations of residuals from their mean over the repetitions of a condition, after an
    /// unweighted fit of `model`; nothing changes if there are no repetitions.
    ///
    /// The residuals lack the part of the noise that the parameters of the trials absorbed, so a fraction of the mean variance is added
    /// to every direction.
    pub fn estimate_noise_from_residuals(&mut self, model: &Model) {
        let fit = Fit::new(self, model, Weighting::Plain);
        let predictions = predictions(self, &fit);
        let samples: Vec<usize> = self.noise_samples().collect();
        let of_trial = |trial: usize| {
            samples.iter().map(|sample| predictions[trial].residual_nm[*sample]).collect::<Vec<f64>>()
        };
        let residuals: Vec<Vec<f64>> = (0..self.trials.len()).map(of_trial).collect();
        let mut deviations = Vec::new();
        for (trial, own) in residuals.iter().enumerate() {
            let repetitions: Vec<&Vec<f64>> = (0..residuals.len())
                .filter(|other| self.trials[*other].condition == self.trials[trial].condition)
                .map(|other| &residuals[other])
                .collect();
            let count = repetitions.len() as f64;
            if count < 2.0 {
                continue;
            }
            let scale = libm::sqrt(count / (count - 1.0));
            let mean_at = |sample: usize| repetitions.iter().map(|r| r[sample]).sum::<f64>() / count;
            deviations.push((0..own.len()).map(|sample| scale * (own[sample] - mean_at(sample))).collect());
        }
        if let Some(mut noise) = NoiseCovariance::estimate(&deviations) {
            let floor = ABSORBED_FRACTION * noise.covariance.trace() / noise.covariance.nrows() as f64;
            for i in 0..noise.covariance.nrows() {
                noise.covariance[(i, i)] += floor;
            }
            self.noise_source = Some(NoiseSource::Residuals);
            self.noise_covariances = vec![noise];
            self.noise_index = vec![Some(0); self.trials.len()];
        }
    }
}
