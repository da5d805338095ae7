//! Predicted torques, residuals and variance accounted for of all trials.

use crate::fit::{Fit, Observations, predict, variance_accounted_for};
use crate::wrist::SimulatedTorque;
use crate::wrist::mechanisms::MechanismKind;

/// Predicted torques of all trials.
pub fn torques(prepared: &Observations, kinds: &[MechanismKind], parameters: &[Vec<f64>]) -> Vec<Vec<f64>> {
    let trials: Vec<usize> = (0..prepared.trials.len()).collect();
    let flat: Vec<f64> = parameters.iter().flatten().copied().collect();
    let mut response = SimulatedTorque::default();
    predict(prepared, kinds, &[], &trials, &flat, &mut response);
    response.torque_nm.chunks_exact(prepared.samples).map(<[f64]>::to_vec).collect()
}

/// Measured less predicted, N m, by trial.
pub fn residuals(prepared: &Observations, fit: &Fit) -> Vec<Vec<f64>> {
    let predicted = torques(prepared, &fit.kinds, &fit.parameters);
    let own = |trial: usize| -> Vec<f64> {
        prepared.trials[trial].measured_nm.iter().zip(&predicted[trial]).map(|(m, p)| m - p).collect()
    };
    (0..predicted.len()).map(own).collect()
}

/// Mean over trials of the variance of the torque accounted for.
pub fn mean_vaf(prepared: &Observations, fit: &Fit) -> f64 {
    let residuals = residuals(prepared, fit);
    let own = |trial: usize| variance_accounted_for(&prepared.trials[trial].measured_nm, &residuals[trial]);
    (0..residuals.len()).map(own).sum::<f64>() / residuals.len() as f64
}
