//! Quantities of a trial that tables report: the six base parameters, and what follows from them.

use super::fit::Fit;
use crate::fit::data::observations::Observations;
use crate::fit::model::parameter_index::X_E;
use crate::wrist::{
    BASE_PARAMETERS, SimulationSettings, TraceSample, runge_kutta_steps, srs_period_s, trace,
};

/// Names of the quantities that tables report for a trial.
pub const QUANTITIES: [&str; 9] = [
    BASE_PARAMETERS[0],
    BASE_PARAMETERS[1],
    BASE_PARAMETERS[2],
    BASE_PARAMETERS[3],
    BASE_PARAMETERS[4],
    BASE_PARAMETERS[5],
    "k_after_nm_per_rad",
    "x_t_s",
    "vaf",
];

impl Fit {
    /// Short-range-stiffness period x_t of a trial, s; `None` if the joint does not reach the elastic limit within the record.
    pub fn x_t_s(&self, observations: &Observations, trial: usize) -> Option<f64> {
        // Most joints reach it in the window, which is the first part of the record.
        let within = |samples| {
            srs_period_s(&trajectory(observations, self, trial, samples), self.parameters[trial][X_E])
        };
        within(observations.samples).or_else(|| within(recorded_samples(observations, trial)))
    }
}

/// Simulates a trial at the optimum of `fit`, from the start of the simulation to the end of the motion that was kept.
pub fn simulated_trajectory(observations: &Observations, fit: &Fit, trial: usize) -> Vec<TraceSample> {
    trajectory(observations, fit, trial, recorded_samples(observations, trial))
}

/// Number of samples from the onset of a trial to the end of the motion that was kept.
fn recorded_samples(observations: &Observations, trial: usize) -> usize {
    let input = &observations.trials[trial].input;
    input.motion.len() - input.onset
}

/// The first `samples` of the simulated trajectory of a trial.
fn trajectory(observations: &Observations, fit: &Fit, trial: usize, samples: usize) -> Vec<TraceSample> {
    let input = &observations.trials[trial].input;
    let parameters = &fit.parameters[trial];
    let substeps =
        runge_kutta_steps(observations.lever, &fit.kinds, input, parameters, observations.period_s);
    let request = SimulationSettings { samples, ..observations.request(&fit.kinds, substeps) };
    trace(&request, input, parameters)
}
