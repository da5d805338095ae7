//! What a residual is worth: the covariance of everything that is not the model.
//!
//! Two sources are told apart because only the first shows in the holds: the torque's own noise (voluntary wander, tremor,
//! gauge), and the error of the recorded angle, which drives the model during the ramp.

use nalgebra::{DMatrix, DVector};

use super::predict::predict;
use super::prepare::Prepared;
use crate::signal::Noise;
use crate::wrist::{Response, knots};

/// Standard deviation below which a direction of the noise is not trusted, N m: the model's own numerical error is some
/// hundred times smaller, a gauge's noise some hundred times larger.
const FLOOR_NM: f64 = 1e-4;

/// The covariance of the residuals for each noise of the session, on [`Prepared::noise_samples`]; `point` are rough values
/// of the six parameters, which tell how an error of the angle becomes one of the torque.
pub fn covariances(prepared: &Prepared, point: &[f64; 6]) -> Vec<Noise> {
    let angle = angle_covariance(prepared, point);
    let with_angle =
        |noise: &Noise| Noise { covariance: &noise.covariance + &angle, stretches: noise.stretches };
    prepared.noises.iter().map(with_angle).collect()
}

/// Matrices that whiten a window's residuals, one a noise of the session; they read every sample of the window.
pub fn whiteners(prepared: &Prepared, covariances: &[Noise]) -> Vec<DMatrix<f64>> {
    let places: Vec<usize> = prepared.noise_samples().collect();
    let spread = |noise: &Noise| {
        let narrow = noise.whitener(FLOOR_NM * FLOOR_NM);
        let mut wide = DMatrix::zeros(narrow.nrows(), prepared.samples);
        for (column, place) in places.iter().enumerate() {
            wide.set_column(*place, &narrow.column(column));
        }
        wide
    };
    covariances.iter().map(spread).collect()
}

/// How many trials, and how many places within an encoder's step, the error of the angle is averaged over.
const TRIALS: usize = 12;
const PLACES: usize = 16;

/// Covariance of the predicted torque's error that the error of the recorded angle makes.
///
/// An angle that is never still is taken to have white noise. One that stands still in the hold is rounded to the encoder's
/// steps: before the ramp by a constant, which then is missing from all of it, slowly turning into noise as the motor gains
/// speed. So the recorded motion is rounded again, from several places within a step, and the error followed through.
fn angle_covariance(prepared: &Prepared, point: &[f64; 6]) -> DMatrix<f64> {
    let places: Vec<usize> = prepared.noise_samples().collect();
    let responses = responses(prepared, point);
    let mut covariance = DMatrix::zeros(places.len(), places.len());
    if prepared.angle_step_rad == 0.0 {
        for wrong in 0..prepared.samples + REACH {
            let mut error = vec![0.0; prepared.samples + REACH];
            error[wrong] = prepared.angle_noise_rad;
            add_square(&mut covariance, &places, &responses, &error);
        }
        return covariance;
    }
    let some = (0..prepared.trials.len()).step_by(prepared.trials.len().div_ceil(TRIALS));
    let count = some.len() * PLACES;
    for trial in some {
        let input = &prepared.trials[trial].input;
        for place in 0..PLACES {
            let offset = prepared.angle_step_rad * (place as f64 + 0.5) / PLACES as f64;
            let rounded = |theta: f64| {
                libm::round((theta + offset) / prepared.angle_step_rad) * prepared.angle_step_rad
                    - offset
                    - theta
            };
            let error: Vec<f64> = (0..prepared.samples + REACH)
                .map(|sample| {
                    let knot = input.motion[(input.onset + sample).min(input.motion.len() - 1)];
                    rounded(knot.theta) - rounded(0.0)
                })
                .collect();
            add_square(&mut covariance, &places, &responses, &error);
        }
    }
    covariance / count as f64
}

/// Adds the square of the torque's error that an error of the angle, sample by sample from the onset, makes.
fn add_square(covariance: &mut DMatrix<f64>, places: &[usize], responses: &[f64], error: &[f64]) {
    let torque = |place: &usize| {
        let first = (place + REACH + 1).saturating_sub(responses.len());
        let last = (place + REACH).min(error.len() - 1);
        (first..=last).map(|wrong| error[wrong] * responses[place + REACH - wrong]).sum::<f64>()
    };
    let torque = DVector::from_iterator(places.len(), places.iter().map(torque));
    *covariance += &torque * torque.transpose();
}

/// How many samples ahead the smoothing of the angle looks.
const REACH: usize = 12;

/// The torque's response to an angle that is wrong at one sample, per rad, from [`REACH`] samples before it.
fn responses(prepared: &Prepared, point: &[f64; 6]) -> Vec<f64> {
    // Small enough to stay where the spring is linear.
    let error_rad = 1e-7;
    let mut alone = prepared.only(&[0]);
    alone.samples += REACH + 1;
    let mut angle = vec![0.0; alone.lead + alone.samples + REACH];
    angle[alone.lead + REACH] = error_rad;
    alone.trials[0].input.motion = knots(&angle, alone.period_s);
    alone.trials[0].input.onset = alone.lead;
    let mut response = Response::default();
    predict(&alone, &[], &[], &[0], point, &mut response);
    response.torque_nm.iter().map(|torque| torque / error_rad).collect()
}
