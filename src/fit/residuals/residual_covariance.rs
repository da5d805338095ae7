//! What a residual is worth: the covariance of everything that is not the model.
//!
//! Two sources are told apart because only the first shows in the holds: the torque's own noise (voluntary wander, tremor,
//! gauge), and the error of the recorded angle, which drives the model during the ramp.

use nalgebra::{DMatrix, DVector};

use super::prediction::predict;
use crate::fit::data::hold_noise::STRETCHES_A_WINDOW;
use crate::fit::data::preprocessing::{Observations, TrialObservation};
use crate::signal::NoiseCovariance;
use crate::wrist::{SimulatedTorque, Smoothing};

/// Standard deviation below which a direction of the noise is not trusted, N m: the model's own numerical error is some
/// hundred times smaller, a gauge's noise some hundred times larger.
const FLOOR_NM: f64 = 1e-4;

/// The covariance of the residuals for each noise of the session, on [`Observations::noise_samples`]; `point` are rough values
/// of the six parameters, which tell how an error of the angle becomes one of the torque.
pub fn covariances(observations: &Observations, point: &[f64; 6]) -> Vec<NoiseCovariance> {
    let angle = angle_covariance(observations, point);
    let with_angle = |noise: &NoiseCovariance| {
        let directions = noise.directions(FLOOR_NM * FLOOR_NM);
        let covariance = (&noise.covariance + &angle) / share_of_precision(noise.stretches, directions);
        NoiseCovariance { covariance, stretches: noise.stretches }
    };
    observations.noise_covariances.iter().map(with_angle).collect()
}

/// Matrices that whiten a window's residuals, one a noise of the session; they read every sample of the window.
pub fn whiteners(observations: &Observations, covariances: &[NoiseCovariance]) -> Vec<DMatrix<f64>> {
    let places: Vec<usize> = observations.noise_samples().collect();
    let spread = |noise: &NoiseCovariance| {
        let narrow = noise.whitener(FLOOR_NM * FLOOR_NM);
        let mut wide = DMatrix::zeros(narrow.nrows(), observations.samples);
        for (column, place) in places.iter().enumerate() {
            wide.set_column(*place, &narrow.column(column));
        }
        wide
    };
    covariances.iter().map(spread).collect()
}

/// What a precision is worth that comes from a covariance of `directions` measured on so many stretches (Hartlap et al. 2007,
/// Eq. 17): inverting it makes its error one-sided, and intervals too short.
fn share_of_precision(stretches: usize, directions: usize) -> f64 {
    let independent = stretches as f64 / STRETCHES_A_WINDOW as f64;
    ((independent - directions as f64 - 2.0) / (independent - 1.0)).max(LEAST_SHARE)
}

/// Where the holds are so short that next to nothing would be left of the precision.
const LEAST_SHARE: f64 = 0.25;

/// At how many places within an encoder's step the motor is taken to rest.
const PLACES: usize = 16;

/// Covariance of the predicted torque's error that the error of the recorded angle makes.
///
/// An angle that is never still is taken to have white noise. One that stands still in the hold is rounded to the encoder's
/// steps. Before the ramp that is a constant, which is then missing from all of it. While the motor is slow, the record waits
/// for the next step; once it passes a step a sample, every sample's rounding is its own.
fn angle_covariance(observations: &Observations, point: &[f64; 6]) -> DMatrix<f64> {
    let places = observations.noise_samples().count();
    observations.angle_smoothings.iter().fold(DMatrix::zeros(places, places), |sum, (share, smoothing)| {
        sum + angle_covariance_of(observations, *smoothing, point) * *share
    })
}

/// The same for an error that is smoothed in one way.
fn angle_covariance_of(observations: &Observations, smoothing: Smoothing, point: &[f64; 6]) -> DMatrix<f64> {
    let places: Vec<usize> = observations.noise_samples().collect();
    let response = TorqueResponse::new(observations, smoothing, point);
    let count = observations.samples + response.reach;
    let mut covariance = DMatrix::zeros(places.len(), places.len());
    let mut add_white = |sd_rad: f64, weight: f64, sample: usize| {
        let mut error = vec![0.0; count];
        error[sample] = sd_rad * libm::sqrt(weight);
        response.add_square(&mut covariance, &places, &error);
    };
    let step = observations.angle_step_rad;
    if step == 0.0 {
        (0..count).for_each(|sample| add_white(observations.angle_noise_rad, 1.0, sample));
        return covariance;
    }
    let motions = mean_motions(observations, count);
    for (share, motion) in &motions {
        let is_fast = |sample: usize| sample > 0 && (motion[sample] - motion[sample - 1]).abs() > step;
        (0..count)
            .filter(|s| is_fast(*s))
            .for_each(|sample| add_white(step / libm::sqrt(12.0), *share, sample));
    }
    for (share, motion) in &motions {
        let is_fast = |sample: usize| sample > 0 && (motion[sample] - motion[sample - 1]).abs() > step;
        for place in 0..PLACES {
            let rest = step * ((place as f64 + 0.5) / PLACES as f64 - 0.5);
            let rounding = |theta: f64| libm::round((theta + rest) / step) * step - (theta + rest);
            let weight = libm::sqrt(share / PLACES as f64);
            let error: Vec<f64> = (0..count)
                .map(|s| weight * (if is_fast(s) { 0.0 } else { rounding(motion[s]) } - rounding(0.0)))
                .collect();
            response.add_square(&mut covariance, &places, &error);
        }
    }
    covariance
}

/// The motor's motion from the onset on, one for each velocity, with its share of the trials. The mean over trials, which
/// rest at different places within a step, shows what happens between the steps.
fn mean_motions(observations: &Observations, count: usize) -> Vec<(f64, Vec<f64>)> {
    let key = |trial: &TrialObservation| (trial.velocity_rad_s.to_bits(), trial.label.clone());
    let mut keys: Vec<_> = observations.trials.iter().map(key).collect();
    keys.sort();
    keys.dedup();
    let of_key = |own: &(u64, Option<String>)| {
        let alike: Vec<&TrialObservation> =
            observations.trials.iter().filter(|trial| key(trial) == *own).collect();
        let at = |sample: usize| {
            let theta = |trial: &&TrialObservation| {
                let motion = &trial.input.motion;
                motion[(trial.input.onset + sample).min(motion.len() - 1)].theta
            };
            alike.iter().map(theta).sum::<f64>() / alike.len() as f64
        };
        let share = alike.len() as f64 / observations.trials.len() as f64;
        (share, (0..count).map(at).collect())
    };
    keys.iter().map(of_key).collect()
}

/// The torque's response to an angle that is wrong at one sample, per rad, from `reach` samples before it: so far ahead the
/// smoothing of the angle pilot_points.
struct TorqueResponse {
    reach: usize,
    nm_per_rad: Vec<f64>,
}

impl TorqueResponse {
    fn new(observations: &Observations, smoothing: Smoothing, point: &[f64; 6]) -> Self {
        // Small enough to stay where the spring is linear.
        let error_rad = 1e-7;
        let reach = smoothing.reach(observations.period_s);
        let mut alone = observations.subset(&[0]);
        alone.samples += reach + 1;
        let mut angle = vec![0.0; alone.lead_samples + alone.samples + 2 * reach];
        angle[alone.lead_samples + reach] = error_rad;
        alone.trials[0].input.motion = smoothing.motion(&angle, alone.period_s);
        alone.trials[0].input.onset = alone.lead_samples;
        let mut response = SimulatedTorque::default();
        predict(&alone, &[], &[], &[0], point, &mut response);
        Self { reach, nm_per_rad: response.torque_nm.iter().map(|torque| torque / error_rad).collect() }
    }

    /// Adds the square of the torque's error that an error of the angle, sample by sample from the onset, makes.
    fn add_square(&self, covariance: &mut DMatrix<f64>, places: &[usize], error: &[f64]) {
        let torque = |place: &usize| {
            let first = (place + self.reach + 1).saturating_sub(self.nm_per_rad.len());
            let last = (place + self.reach).min(error.len() - 1);
            (first..=last)
                .map(|wrong| error[wrong] * self.nm_per_rad[place + self.reach - wrong])
                .sum::<f64>()
        };
        let torque = DVector::from_iterator(places.len(), places.iter().map(torque));
        *covariance += &torque * torque.transpose();
    }
}
