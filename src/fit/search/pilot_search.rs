//! Pilot search: a random search over the parameter space of one trial, with scales read from its record.
//!
//! The scales come from the data rather than from a typical wrist, so that another joint gets suitable starting values as well.

use crate::fit::data::observations::Observations;
use crate::fit::residuals::prediction::predict;
use crate::random::Stream;
use crate::wrist::SimulatedTorque;

/// Number of points of the parameter space at which the pilot trial is simulated.
const POINTS: usize = 128;

/// Number of points, the best ones, that the pilot search returns.
const POINTS_KEPT: usize = 2;

/// The best points of the pilot trial's parameter space by the sum of squared residuals, the best first.
pub fn pilot_points(observations: &Observations) -> Vec<[f64; 6]> {
    let pilot = observations.subset(&[pilot_trial(observations)]);
    let points = random_points(&pilot, pilot.peak_angle_rad(0));
    let flat: Vec<f64> = points.iter().flatten().copied().collect();
    let mut response = SimulatedTorque::default();
    predict(&pilot, &[], &[], &vec![0; points.len()], &flat, &mut response);
    let measured = &pilot.trials[0].measured_nm;
    let cost = |torque: &[f64]| torque.iter().zip(measured).map(|(p, m)| (p - m) * (p - m)).sum::<f64>();
    let mut ranked: Vec<(f64, [f64; 6])> = response
        .torque_nm
        .chunks_exact(pilot.rows())
        .map(cost)
        .zip(points)
        .filter(|(c, _)| c.is_finite())
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().take(POINTS_KEPT).map(|(_, point)| point).collect()
}

/// Index of the trial with the median torque peak.
fn pilot_trial(observations: &Observations) -> usize {
    let mut order: Vec<usize> = (0..observations.trials.len()).collect();
    let peak = |trial: usize| peak_torque_nm(observations.torque_of(&observations.trials[trial].measured_nm));
    order.sort_by(|a, b| peak(*a).total_cmp(&peak(*b)));
    order[order.len() / 2]
}

/// Largest absolute value of a torque, N m.
fn peak_torque_nm(torque_nm: &[f64]) -> f64 {
    torque_nm.iter().map(|t| t.abs()).fold(0.0, f64::max)
}

/// Points of the parameter space, log-uniform about scales of the record of the only trial of `pilot`.
fn random_points(pilot: &Observations, peak_angle_rad: f64) -> Vec<[f64; 6]> {
    let trial = &pilot.trials[0];
    let torque_nm = pilot.torque_of(&trial.measured_nm);
    let peak = peak_torque_nm(torque_nm);
    // The first torque peak accelerates the inertias to the speed of the ramp.
    let top_speed = trial.input.motion.iter().map(|k| k.omega).fold(1e-3, f64::max);
    let peak_at = torque_nm.iter().position(|t| t.abs() == peak).unwrap_or(1).max(1);
    let inertia = 0.5 * peak * peak_at as f64 * pilot.period_s / top_speed;
    let stiffness = peak / peak_angle_rad;
    let mut stream = Stream::new(0, "pilot");
    let mut log_uniform = |low: f64, high: f64| low * libm::exp(stream.uniform() * libm::log(high / low));
    (0..POINTS)
        .map(|_| {
            let i_j = inertia * log_uniform(0.1, 3.0);
            let k_srs = stiffness * log_uniform(0.1, 5.0);
            let k_h = k_srs * log_uniform(3.0, 60.0);
            let b_h = 2.0 * log_uniform(0.05, 1.0) * libm::sqrt(k_h * i_j);
            [i_j, b_h, k_h, k_srs, k_srs * log_uniform(0.2, 0.9), peak_angle_rad * log_uniform(0.3, 0.8)]
        })
        .collect()
}
