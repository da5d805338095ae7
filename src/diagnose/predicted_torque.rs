//! Predicted torques, residuals and variance accounted for of all trials.

use nalgebra::DVector;

use crate::fit::{Fit, Observations, predict, variance_accounted_for};
use crate::wrist::SimulatedTorque;
use crate::wrist::mechanisms::MechanismKind;

/// Predicted torques of all trials, N m, with their further channels, for mechanisms `kinds` and one parameter vector per trial.
pub fn torques(
    observations: &Observations,
    kinds: &[MechanismKind],
    parameters: &[Vec<f64>],
) -> Vec<Vec<f64>> {
    let trials: Vec<usize> = (0..observations.trials.len()).collect();
    let flat: Vec<f64> = parameters.iter().flatten().copied().collect();
    let mut response = SimulatedTorque::default();
    predict(observations, kinds, &[], &trials, &flat, &mut response);
    response.torque_nm.chunks_exact(observations.rows()).map(<[f64]>::to_vec).collect()
}

/// By how much the whitened torques of all trials change `from` those of one model `to` those of another.
pub fn whitened_change(
    observations: &Observations,
    fit: &Fit,
    from: &[Vec<f64>],
    to: &[Vec<f64>],
) -> Vec<DVector<f64>> {
    let change = |trial: usize| {
        let by: Vec<f64> = to[trial].iter().zip(&from[trial]).map(|(to, from)| to - from).collect();
        fit.objective.whiten(observations.noise_index[trial], &by)
    };
    (0..from.len()).map(change).collect()
}

/// Residuals (measured less predicted) of all trials, N m: those of the torque, then those of the further channels.
pub fn residuals(observations: &Observations, fit: &Fit) -> Vec<Vec<f64>> {
    let predicted = torques(observations, &fit.kinds, &fit.parameters);
    let own = |trial: usize| -> Vec<f64> {
        observations.trials[trial].measured_nm.iter().zip(&predicted[trial]).map(|(m, p)| m - p).collect()
    };
    (0..predicted.len()).map(own).collect()
}

/// Variance of the torque accounted for (VAF, 1 if all), mean over trials.
pub fn mean_vaf(observations: &Observations, fit: &Fit) -> f64 {
    let residuals = residuals(observations, fit);
    let own = |trial: usize| {
        let measured = observations.torque_of(&observations.trials[trial].measured_nm);
        variance_accounted_for(measured, observations.torque_of(&residuals[trial]))
    };
    (0..residuals.len()).map(own).sum::<f64>() / residuals.len() as f64
}
