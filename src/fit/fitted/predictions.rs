//! Predictions of a fit: torque, residuals and derivatives of each trial at the optimum.

use nalgebra::DMatrix;

use super::fit::Fit;
use crate::fit::data::observations::Observations;
use crate::fit::residuals::prediction::predict;
use crate::wrist::SimulatedTorque;

/// The prediction of one trial.
pub struct Prediction {
    /// Predicted torque, N m; one value per sample of the window. The further channels follow, scaled to N m.
    pub torque_nm: Vec<f64>,
    /// Residuals: measured less predicted values, N m.
    pub residual_nm: Vec<f64>,
    /// Derivatives of the predicted values: values by estimated parameters.
    pub jacobian: DMatrix<f64>,
}

/// Predictions of all trials at the optimum of `fit`.
pub fn predictions(observations: &Observations, fit: &Fit) -> Vec<Prediction> {
    let trials: Vec<usize> = (0..observations.trials.len()).collect();
    let flat: Vec<f64> = fit.parameters.iter().flatten().copied().collect();
    let estimated = &fit.parameterisation.estimated;
    let mut response = SimulatedTorque::default();
    predict(observations, &fit.kinds, estimated, &trials, &flat, &mut response);
    let samples = observations.rows();
    trials
        .iter()
        .map(|trial| {
            let torque_nm = response.torque_nm[trial * samples..(trial + 1) * samples].to_vec();
            let slopes =
                &response.slopes[trial * samples * estimated.len()..(trial + 1) * samples * estimated.len()];
            let measured = &observations.trials[*trial].measured_nm;
            Prediction {
                residual_nm: measured.iter().zip(&torque_nm).map(|(m, p)| m - p).collect(),
                torque_nm,
                jacobian: DMatrix::from_row_slice(samples, estimated.len(), slopes),
            }
        })
        .collect()
}

/// Variance accounted for of the torque (Eq. 8; the paper prints the equation with the angle, but torque is what is fitted).
pub fn variance_accounted_for(measured_nm: &[f64], residual_nm: &[f64]) -> f64 {
    let square = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
    1.0 - square(residual_nm) / square(measured_nm)
}
