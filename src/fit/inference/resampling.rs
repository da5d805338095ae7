//! Parametric resampling: simulated sessions with predicted torques and new noise.

use nalgebra::{DMatrix, DVector};

use crate::fit::data::observations::Observations;
use crate::random::Stream;
use crate::signal::NoiseCovariance;

/// Sampler of Gaussian noise with given covariances.
pub struct NoiseSampler {
    /// For each covariance C a matrix A with A A' = C.
    factors: Vec<DMatrix<f64>>,
}

impl NoiseSampler {
    /// A sampler for `covariances`, in the order of [`Observations::noise_covariances`].
    pub fn new(covariances: &[NoiseCovariance]) -> Self {
        let factor = |noise: &NoiseCovariance| {
            let eigen = noise.covariance.clone().symmetric_eigen();
            let scale = DVector::from_iterator(
                eigen.eigenvalues.len(),
                eigen.eigenvalues.iter().map(|value| libm::sqrt(value.max(0.0))),
            );
            &eigen.eigenvectors * DMatrix::from_diagonal(&scale)
        };
        Self { factors: covariances.iter().map(factor).collect() }
    }
}

/// A simulated session: the measured torque is `predicted`, N m by trial and sample, plus noise from `noise` on the noise samples.
pub fn draw_observations(
    observations: &Observations,
    predicted: &[Vec<f64>],
    noise: &NoiseSampler,
    stream: &mut Stream,
) -> Observations {
    let mut simulated = observations.clone();
    let samples: Vec<usize> = observations.noise_samples().collect();
    for (trial, own) in simulated.trials.iter_mut().enumerate() {
        own.measured_nm.clone_from(&predicted[trial]);
        let Some(index) = observations.noise_index[trial] else { continue };
        let normals = DVector::from_fn(samples.len(), |_, _| stream.normal());
        let drawn = &noise.factors[index] * normals;
        for (sample, value) in samples.iter().zip(drawn.iter()) {
            own.measured_nm[*sample] += value;
        }
    }
    simulated
}
