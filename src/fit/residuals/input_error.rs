//! Errors-in-variables: the covariance of the torque error that the error of the recorded angle causes.

use nalgebra::{DMatrix, DVector};

use super::prediction::predict;
use crate::fit::data::observations::{Observations, TrialObservation};
use crate::signal::filter;
use crate::wrist::{Kinematics, SimulatedTorque, Smoothing};

/// Part of a motion's error for which the model is linear: no yield is near.
const SMALL_PART: f64 = 1e-3;

/// Number of rest positions within a step of the encoder over which the quantisation error is averaged.
const REST_POSITIONS: usize = 16;

/// Covariance, (N m)^2, of the error of the predicted torque on the noise samples that the error of the recorded angle causes.
/// `point` are rough values of the base parameters.
///
/// The error of an angle that is not quantised is white noise. A quantised angle is rounded to the steps of the encoder: before
/// the ramp the rounding error is constant, and it is subtracted from the whole window; while the motor is slow, the error
/// follows the motion; once the motor passes a step per sample, the rounding errors of the samples are independent.
pub fn input_error_covariance(observations: &Observations, point: &[f64; 6]) -> DMatrix<f64> {
    let samples = observations.noise_samples().count();
    observations.angle_smoothings.iter().fold(DMatrix::zeros(samples, samples), |sum, (share, smoothing)| {
        sum + smoothed_error_covariance(observations, *smoothing, point) * *share
    })
}

/// Covariance, (N m)^2, on the noise samples, of the torque error from what is unknown of each trial's own motion, for the trials of the noise
/// covariance number `noise`; `None` where the motions are not those between steps of an encoder. `point` are rough values of the base
/// parameters.
pub fn own_motion_error_covariance(
    observations: &Observations,
    noise: usize,
    point: &[f64; 6],
) -> Option<DMatrix<f64>> {
    let trial = observations.noise_index.iter().position(|own| *own == Some(noise))?;
    let errors = observations.trials[trial].motion_errors.as_ref()?;
    let values: Vec<usize> = observations.noise_samples().collect();
    let mut covariance = DMatrix::zeros(values.len(), values.len());
    let mut single = observations.subset(&[trial]);
    let mut response = SimulatedTorque::default();
    for error in errors.own.iter() {
        // From rest, and small enough for the model to be linear.
        let small = |knot: &Kinematics<f64>| Kinematics {
            theta: SMALL_PART * knot.theta,
            omega: SMALL_PART * knot.omega,
        };
        single.trials[0].input.motion = error.iter().map(small).collect();
        predict(&single, &[], &[], &[0], point, &mut response);
        let torque = values.iter().map(|value| response.torque_nm[*value] / SMALL_PART);
        let torque = DVector::from_iterator(values.len(), torque);
        covariance += &torque * torque.transpose();
    }
    Some(covariance)
}

/// The part of `input_error_covariance` that trials of one velocity have in common, since their motions are averaged; zero where they
/// are not.
pub fn common_input_error_covariance(observations: &Observations, point: &[f64; 6]) -> DMatrix<f64> {
    match observations.angle_smoothings.as_slice() {
        [(share, smoothing), _, ..] => smoothed_error_covariance(observations, *smoothing, point) * *share,
        _ => {
            let samples = observations.noise_samples().count();
            DMatrix::zeros(samples, samples)
        }
    }
}

/// The covariance of [`input_error_covariance`] for an angle error that passes one smoothing.
fn smoothed_error_covariance(
    observations: &Observations,
    smoothing: Smoothing,
    point: &[f64; 6],
) -> DMatrix<f64> {
    let samples: Vec<usize> = observations.noise_samples().collect();
    let response = ImpulseResponse::new(observations, smoothing, point);
    let count = observations.samples + response.reach;
    let mut covariance = DMatrix::zeros(samples.len(), samples.len());
    let mut add = |error: &[f64]| {
        response.add_outer_product(&mut covariance, observations.samples, &samples, error);
    };
    let step = observations.angle_step_rad;
    if step == 0.0 {
        (0..count).for_each(|sample| add(&white(count, observations.angle_noise_rad, 1.0, sample)));
        return covariance;
    }
    let motor = |trial: &TrialObservation, sample: usize| {
        let motion = &trial.input.motion;
        motion[(trial.input.onset + sample).min(motion.len() - 1)].theta
    };
    each_rounding_error(&mean_motions(observations, count, motor), step, add);
    covariance
}

/// Covariance, (N m)^2, on the noise samples, of the rounding errors of the encoders among the further channels. The encoder of a
/// motor at rest does not show the error in the holds.
pub fn further_encoder_covariance(observations: &Observations) -> DMatrix<f64> {
    let samples: Vec<usize> = observations.noise_samples().collect();
    let mut covariance = DMatrix::zeros(samples.len(), samples.len());
    for (place, further) in observations.further.iter().enumerate() {
        let step = observations.further_step[place];
        if step == 0.0 {
            continue;
        }
        let response = ImpulseResponse::of_filter(observations, place);
        let angle = |trial: &TrialObservation, sample: usize| {
            observations.further_of(place, &trial.measured_nm)[sample] / further.nm_per_unit
        };
        let motions = mean_motions(observations, observations.samples, angle);
        each_rounding_error(&motions, step, |error| {
            response.add_outer_product(&mut covariance, observations.samples, &samples, error);
        });
    }
    covariance
}

/// An error at one sample, in rad, of `count`.
fn white(count: usize, sd_rad: f64, weight: f64, sample: usize) -> Vec<f64> {
    let mut error = vec![0.0; count];
    error[sample] = sd_rad * libm::sqrt(weight);
    error
}

/// Calls `add` with independent rounding errors of an encoder with steps of `step`, in rad sample by sample from the onset, whose outer
/// products sum up to their covariance over `motions`, each with its share.
fn each_rounding_error(motions: &[(f64, Vec<f64>)], step: f64, mut add: impl FnMut(&[f64])) {
    for (share, motion) in motions {
        let is_fast = |sample: usize| sample > 0 && (motion[sample] - motion[sample - 1]).abs() > step;
        (0..motion.len())
            .filter(|s| is_fast(*s))
            .for_each(|sample| add(&white(motion.len(), step / libm::sqrt(12.0), *share, sample)));
    }
    for (share, motion) in motions {
        let is_fast = |sample: usize| sample > 0 && (motion[sample] - motion[sample - 1]).abs() > step;
        for position in 0..REST_POSITIONS {
            let rest = step * ((position as f64 + 0.5) / REST_POSITIONS as f64 - 0.5);
            let rounding = |theta: f64| libm::round((theta + rest) / step) * step - (theta + rest);
            let weight = libm::sqrt(share / REST_POSITIONS as f64);
            let error: Vec<f64> = (0..motion.len())
                .map(|s| weight * (if is_fast(s) { 0.0 } else { rounding(motion[s]) } - rounding(0.0)))
                .collect();
            add(&error);
        }
    }
}

/// Mean of an angle from the onset on, rad, for each velocity, with the share of the trials that have this velocity. The trials rest
/// at different positions within a step of the encoder, so their mean resolves the motion within a step.
fn mean_motions(
    observations: &Observations,
    count: usize,
    angle: impl Fn(&TrialObservation, usize) -> f64,
) -> Vec<(f64, Vec<f64>)> {
    let of_velocity = |alike: Vec<usize>| {
        let own = || alike.iter().map(|trial| &observations.trials[*trial]);
        let at = |sample: usize| own().map(|trial| angle(trial, sample)).sum::<f64>() / alike.len() as f64;
        let share = alike.len() as f64 / observations.trials.len() as f64;
        (share, (0..count).map(at).collect())
    };
    observations.trials_of_velocities().into_iter().map(of_velocity).collect()
}

/// Impulse response of the channels to an error of an angle at one sample.
struct ImpulseResponse {
    /// Number of samples by which the response precedes the error, because the smoothing of the angle looks ahead.
    reach: usize,
    /// The response of each channel, N m/rad, from `reach` samples before the error on; empty for a channel without a response.
    nm_per_rad: Vec<Vec<f64>>,
}

impl ImpulseResponse {
    /// Impulse response of the base model at the parameters `point` to an error of the motor angle.
    fn new(observations: &Observations, smoothing: Smoothing, point: &[f64; 6]) -> Self {
        // Small enough for the model to be linear.
        let error_rad = 1e-7;
        // A torque record that is early answers before the angle moves.
        let early_s = (-observations.constants.torque_delay_s).max(0.0);
        let reach =
            smoothing.reach(observations.period_s) + libm::ceil(early_s / observations.period_s) as usize;
        let mut single = observations.subset(&[0]);
        single.samples += reach + 1;
        let mut angle = vec![0.0; single.lead_samples + single.samples + 2 * reach];
        angle[single.lead_samples + reach] = error_rad;
        single.trials[0].input.motion = single.as_torque_sees(smoothing.motion(&angle, single.period_s));
        single.trials[0].input.onset = single.lead_samples;
        let mut response = SimulatedTorque::default();
        predict(&single, &[], &[], &[0], point, &mut response);
        let of_channel = |own: &[f64]| own.iter().map(|torque| torque / error_rad).collect();
        Self { reach, nm_per_rad: response.torque_nm.chunks_exact(single.samples).map(of_channel).collect() }
    }

    /// Impulse response of the further channel number `place` to an error of its own, which passes the filter alone.
    fn of_filter(observations: &Observations, place: usize) -> Self {
        let mut impulse = vec![0.0; observations.samples];
        impulse[0] = observations.further[place].nm_per_unit;
        let mut nm_per_rad = vec![Vec::new(); 1 + observations.further.len()];
        nm_per_rad[1 + place] = filter(&observations.sections, &impulse);
        Self { reach: 0, nm_per_rad }
    }

    /// Adds to `covariance` the outer product of the error at `values` that the angle error `error` causes, given in rad sample by sample
    /// from the onset. A trial has `samples` values of each channel.
    fn add_outer_product(
        &self,
        covariance: &mut DMatrix<f64>,
        samples: usize,
        values: &[usize],
        error: &[f64],
    ) {
        let torque = |value: &usize| {
            let (response, sample) = (&self.nm_per_rad[value / samples], value % samples);
            if response.is_empty() {
                return 0.0;
            }
            let first = (sample + self.reach + 1).saturating_sub(response.len());
            let last = (sample + self.reach).min(error.len() - 1);
            (first..=last).map(|wrong| error[wrong] * response[sample + self.reach - wrong]).sum::<f64>()
        };
        let torque = DVector::from_iterator(values.len(), values.iter().map(torque));
        *covariance += &torque * torque.transpose();
    }
}
