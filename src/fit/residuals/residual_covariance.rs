//! Covariance of the residuals: noise of the channels plus the error of the recorded angle, carried through the model, plus the
//! quantisation of further encoders.
//!
//! The holds show only the first source (voluntary drift, tremor, noise of the gauge). The error of the angle drives the model
//! during the ramp; see [`super::input_error`].

use std::collections::BTreeSet;

use nalgebra::DMatrix;

use super::channel_covariance::{enlarged, whitener};
use super::input_error::{further_encoder_covariance, input_error_covariance, own_motion_error_covariance};
use crate::fit::data::hold_noise::STRETCHES_PER_WINDOW;
use crate::fit::data::observations::Observations;
use crate::signal::NoiseCovariance;

/// Standard deviation below which a direction of the noise is dropped, N m: the numerical error of the model is some hundred times
/// smaller, the noise of a gauge some hundred times larger.
const FLOOR_NM: f64 = 1e-4;

/// Smallest factor by which a precision is reduced, for holds so short that hardly any of it would remain.
const MIN_PRECISION_FACTOR: f64 = 0.25;

/// Covariance of the residuals for each noise covariance of the session, on the noise samples. `point` are rough values of the base
/// parameters, which determine how an error of the angle becomes an error of the torque.
pub fn residual_covariances(observations: &Observations, point: &[f64; 6]) -> Vec<NoiseCovariance> {
    let further_error = further_encoder_covariance(observations) * trials_of_a_condition(observations);
    // The same for all trials, unless their motions are those between the steps of an encoder.
    let of_all = std::cell::OnceCell::new();
    let samples = observations.window_noise_samples().count();
    let with_input_error = |(place, noise): (usize, &NoiseCovariance)| {
        let input_error = own_motion_error_covariance(observations, place, point)
            .unwrap_or_else(|| of_all.get_or_init(|| input_error_covariance(observations, point)).clone());
        let factors: Vec<f64> =
            channel_factors(noise, samples).into_iter().map(|(factor, _)| factor).collect();
        let covariance = enlarged(
            &(&noise.covariance + (input_error + &further_error)),
            &factors,
            samples,
            FLOOR_NM * FLOOR_NM,
        );
        NoiseCovariance { covariance, stretches: noise.stretches }
    };
    observations.noise_covariances.iter().enumerate().map(with_input_error).collect()
}

/// Mean number of trials that share the rounding errors of further encoders, as trials of one condition rest and move alike. An error
/// that n trials share counts n times in each, so that it has its right weight in what is common to them; a single trial's own
/// estimates are then more uncertain than they need be.
fn trials_of_a_condition(observations: &Observations) -> f64 {
    let conditions: BTreeSet<usize> = observations.trials.iter().map(|trial| trial.condition).collect();
    observations.trials.len() as f64 / conditions.len().max(1) as f64
}

/// Variance of whitened noise, for each noise covariance of the session: below one by as much as the covariances were enlarged, in the
/// mean over the directions of all channels.
pub fn precision_factors(observations: &Observations) -> Vec<f64> {
    let samples = observations.window_noise_samples().count();
    let factor = |noise: &NoiseCovariance| match channel_factors(noise, samples).as_slice() {
        [(only, _)] => *only,
        several => {
            let directions: usize = several.iter().map(|(_, directions)| directions).sum();
            several.iter().map(|(factor, own)| factor * *own as f64).sum::<f64>() / directions.max(1) as f64
        }
    };
    observations.noise_covariances.iter().map(factor).collect()
}

/// Of each channel with `samples` noise samples, the factor of its precision given the channels before it, and the number of directions
/// that it adds.
fn channel_factors(noise: &NoiseCovariance, samples: usize) -> Vec<(f64, usize)> {
    let mut before = 0;
    let mut factors = Vec::new();
    for channels in 1..=noise.covariance.nrows() / samples {
        let directions = noise.of_first(channels * samples).directions(FLOOR_NM * FLOOR_NM);
        factors.push((precision_factor(noise.stretches, directions), directions.saturating_sub(before)));
        before = directions;
    }
    factors
}

/// How large the variance of the torque error from the recorded angle is, beside that of the torque's own noise; the largest of
/// `covariances`, which are those of [`residual_covariances`].
pub fn angle_error_ratio(observations: &Observations, covariances: &[NoiseCovariance]) -> f64 {
    let samples = observations.window_noise_samples().count();
    let ratio = |(noise, whole): (&NoiseCovariance, &NoiseCovariance)| {
        let (noise, whole) = (noise.of_first(samples), whole.of_first(samples));
        let directions = noise.directions(FLOOR_NM * FLOOR_NM);
        let whole = whole.covariance.trace() * precision_factor(noise.stretches, directions);
        whole / noise.covariance.trace() - 1.0
    };
    observations.noise_covariances.iter().zip(covariances).map(ratio).fold(0.0, f64::max)
}

/// Whitening matrix for each of `covariances`. It has one column per value of a trial; columns between noise samples are zero.
pub fn whitening_matrices(observations: &Observations, covariances: &[NoiseCovariance]) -> Vec<DMatrix<f64>> {
    let samples: Vec<usize> = observations.noise_samples().collect();
    let per_channel = observations.window_noise_samples().count();
    let on_all_samples = |noise: &NoiseCovariance| {
        let whitener = whitener(&noise.covariance, per_channel, FLOOR_NM * FLOOR_NM);
        let mut wide = DMatrix::zeros(whitener.nrows(), observations.rows());
        for (column, sample) in samples.iter().enumerate() {
            wide.set_column(*sample, &whitener.column(column));
        }
        wide
    };
    covariances.iter().map(on_all_samples).collect()
}

/// Factor that removes the bias of a precision, the inverse of a covariance of `directions` dimensions estimated from `stretches`
/// overlapping stretches (Hartlap et al. 2007, Eq. 17). Without it, intervals would be too short.
fn precision_factor(stretches: usize, directions: usize) -> f64 {
    let independent = stretches as f64 / STRETCHES_PER_WINDOW as f64;
    ((independent - directions as f64 - 2.0) / (independent - 1.0)).max(MIN_PRECISION_FACTOR)
}
