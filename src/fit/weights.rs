//! What a residual is worth: the covariance of everything that is not the model.
//!
//! Two sources are told apart because only the first shows in the holds: the torque's own noise (voluntary wander, tremor,
//! gauge), and the error of the recorded angle, which drives the model during the ramp.

use nalgebra::{DMatrix, DVector};

use super::normal::predict;
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

/// Covariance of the predicted torque's error that the error of the recorded angle makes: the model's response to an angle
/// that is wrong at one sample, for every sample that reaches into the window.
fn angle_covariance(prepared: &Prepared, point: &[f64; 6]) -> DMatrix<f64> {
    let places: Vec<usize> = prepared.noise_samples().collect();
    // Small enough to stay where the spring is linear.
    let error_rad = 1e-7;
    let mut alone = prepared.only(&[0]);
    let length = alone.lead + 2 * alone.samples + 8;
    let mut angle = vec![0.0; length];
    angle[alone.lead + 4] = error_rad;
    alone.trials[0].input.motion = knots(&angle, alone.period_s);
    alone.trials[0].input.onset = alone.lead;
    let mut response = Response::default();
    predict(&alone, &[], &[], &[0], point, &mut response);
    // response[k] is the torque k - 4 samples after the wrong one.
    let mut covariance = DMatrix::zeros(places.len(), places.len());
    for wrong in -(prepared.samples as isize)..prepared.samples as isize + 4 {
        let error = DVector::from_iterator(
            places.len(),
            places.iter().map(|place| {
                let since = *place as isize - wrong + 4;
                usize::try_from(since).ok().and_then(|k| response.torque_nm.get(k)).copied().unwrap_or(0.0)
                    / error_rad
            }),
        );
        covariance += &error * error.transpose();
    }
    covariance * (prepared.angle_noise_rad * prepared.angle_noise_rad)
}
