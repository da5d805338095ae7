//! The session again as it might have come out: the fitted model with fresh noise. What a parametric bootstrap refits.

use nalgebra::{DMatrix, DVector};

use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::fit::Fit;
use crate::random::Stream;
use crate::signal::NoiseCovariance;

/// Draws noise with the measured covariances.
pub struct NoiseSampler {
    factors: Vec<DMatrix<f64>>,
}

impl NoiseSampler {
    /// For everything that `fit` takes for noise, the error of the angle included.
    pub fn new(fit: &Fit) -> Self {
        Self::of(&fit.residual_covariances)
    }

    /// For these noise_covariances.
    pub fn of(noise_covariances: &[NoiseCovariance]) -> Self {
        let factor = |noise: &NoiseCovariance| {
            let eigen = noise.covariance.clone().symmetric_eigen();
            let scale = DVector::from_iterator(
                eigen.eigenvalues.len(),
                eigen.eigenvalues.iter().map(|value| libm::sqrt(value.max(0.0))),
            );
            &eigen.eigenvectors * DMatrix::from_diagonal(&scale)
        };
        Self { factors: noise_covariances.iter().map(factor).collect() }
    }
}

/// A session in which the predictions are right: measured torque is prediction plus noise, where noise is looked at.
pub fn draw_observations(
    observations: &Observations,
    predicted: &[Vec<f64>],
    noise: &NoiseSampler,
    stream: &mut Stream,
) -> Observations {
    let mut simulated = observations.clone();
    let places: Vec<usize> = observations.noise_samples().collect();
    for (trial, own) in simulated.trials.iter_mut().enumerate() {
        own.measured_nm.clone_from(&predicted[trial]);
        let Some(index) = observations.noise_index[trial] else { continue };
        let normals = DVector::from_fn(places.len(), |_, _| stream.normal());
        let drawn = &noise.factors[index] * normals;
        for (place, value) in places.iter().zip(drawn.iter()) {
            own.measured_nm[*place] += value;
        }
    }
    simulated
}
