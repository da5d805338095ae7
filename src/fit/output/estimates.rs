//! Estimates by trial and by condition, as tables and files report them.

use serde::Serialize;

use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::{predictions, variance_accounted_for};
use crate::fit::fitted::quantities::QUANTITIES;
use crate::fit::fitted::uncertainty::uncertainties;
use crate::fit::inference::profile::{ProfileInterval, profiles};
use crate::fit::model::parameter_index::{K_DEC, K_SRS};
use crate::fit::solver::levenberg_marquardt::Termination;
use crate::wrist::BASE_PARAMETERS;

/// Estimates of one trial.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialEstimate {
    /// Number of the trial in the session.
    pub trial: u32,
    /// Label of the condition, if the session has labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Repetition index, from 1.
    pub repetition: u32,
    /// The six base parameters, in the order of [`BASE_PARAMETERS`].
    pub values: [f64; 6],
    /// Stiffness beyond the elastic limit, k_srs - k_dec, N m/rad.
    pub k_after_nm_per_rad: f64,
    /// Short-range-stiffness period x_t, s; `None` if the joint does not reach the elastic limit within the record.
    pub x_t_s: Option<f64>,
    /// Variance accounted for of the torque (Eq. 8).
    pub vaf: f64,
    /// Standard error of Eq. 9, relative to each parameter; `None` if not determined.
    pub sem: [Option<f64>; 6],
    /// Standard error from the covariance of the residuals, relative to each parameter; `None` if not determined.
    pub se: [Option<f64>; 6],
    /// 95 % profile likelihood intervals of k_dec and x_e; `None` if the parameter is not the trial's own, or not computed.
    #[serde(skip)]
    pub profile: [Option<ProfileInterval>; 2],
    /// Whether the optimisation converged.
    pub converged: bool,
    /// Remarks as text for a reader: why the optimisation ended, parameters at a bound, other optima.
    pub remarks: Vec<String>,
}

/// Means and standard deviations over the repetitions of one condition.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionEstimate {
    /// Label of the condition, if the session has labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Number of repetitions.
    pub repetitions: usize,
    /// Means over the repetitions, in the order of [`QUANTITIES`]; `None` if no repetition has a value.
    pub mean: [Option<f64>; 9],
    /// Standard deviations, in the order of [`QUANTITIES`]; `None` if fewer than two repetitions have a value.
    pub sd: [Option<f64>; 9],
}

impl TrialEstimate {
    /// Values in the order of [`QUANTITIES`].
    pub fn quantities(&self) -> [Option<f64>; 9] {
        let v = &self.values;
        [
            Some(v[0]),
            Some(v[1]),
            Some(v[2]),
            Some(v[3]),
            Some(v[4]),
            Some(v[5]),
            Some(self.k_after_nm_per_rad),
            self.x_t_s,
            Some(self.vaf),
        ]
    }
}

/// Estimates of all trials with profile likelihood intervals, ordered by condition and repetition.
pub fn estimates(observations: &Observations, fit: &Fit) -> Vec<TrialEstimate> {
    with_profiles(observations, fit, &profiles(observations, fit))
}

/// Estimates of all trials without profile likelihood intervals, which take longer than everything else and are not part of a study.
pub fn estimates_without_profiles(observations: &Observations, fit: &Fit) -> Vec<TrialEstimate> {
    with_profiles(observations, fit, &vec![[None; 2]; observations.trials.len()])
}

fn with_profiles(
    observations: &Observations,
    fit: &Fit,
    profiles: &[[Option<ProfileInterval>; 2]],
) -> Vec<TrialEstimate> {
    let predictions = predictions(observations, fit);
    let uncertainties = uncertainties(observations, fit, &predictions);
    let of_trial = |index: usize| {
        let trial = &observations.trials[index];
        let mut values = [0.0; 6];
        values.copy_from_slice(&fit.parameters[index][..BASE_PARAMETERS.len()]);
        TrialEstimate {
            trial: trial.number,
            condition: trial.label.clone(),
            velocity_rad_s: trial.velocity_rad_s,
            torque_nm: trial.torque_nm,
            repetition: trial.repetition,
            k_after_nm_per_rad: values[K_SRS] - values[K_DEC],
            x_t_s: fit.x_t_s(observations, index),
            vaf: variance_accounted_for(&trial.measured_nm, &predictions[index].residual_nm),
            sem: uncertainties[index].sem,
            se: uncertainties[index].se,
            profile: profiles[index],
            converged: fit.outcome(index).termination == Termination::Converged,
            remarks: remarks(fit, index),
            values,
        }
    };
    (0..observations.trials.len()).map(of_trial).collect()
}

/// Remarks on a trial, as text for a reader.
fn remarks(fit: &Fit, index: usize) -> Vec<String> {
    let mut remarks = Vec::new();
    match fit.outcome(index).termination {
        Termination::Converged => {}
        Termination::Stalled => {
            remarks.push("not converged: no step improves the fit, the problem is flat or singular".into())
        }
        Termination::Iterations => remarks.push("not converged: the limit of iterations was reached".into()),
        Termination::NotFinite => {
            remarks.push("not converged: the model cannot be evaluated at the starting values".into())
        }
    }
    for (parameter, name) in BASE_PARAMETERS.iter().enumerate() {
        if fit.at_bound(index, parameter) {
            remarks.push(format!("{name} ended at its bound: the data do not determine it"));
        }
    }
    let own = &fit.parameters[index];
    if own[K_DEC] > own[K_SRS] {
        remarks.push(
            "k_after is below zero: beyond the elastic limit the torque falls, which a stiffness cannot explain".into(),
        );
    }
    if fit.ambiguous_trials.contains(&index) {
        remarks.push("another optimum with a different x_e fits as well within the noise".into());
    }
    remarks
}

/// Means and standard deviations over the repetitions of each condition; `estimates` are ordered by condition.
pub fn by_condition(estimates: &[TrialEstimate]) -> Vec<ConditionEstimate> {
    let same = |a: &TrialEstimate, b: &TrialEstimate| match (&a.condition, &b.condition) {
        (Some(a), Some(b)) => a == b,
        _ => a.velocity_rad_s == b.velocity_rad_s && a.torque_nm == b.torque_nm,
    };
    estimates
        .chunk_by(same)
        .map(|group| {
            let (mut means, mut sds) = ([None; 9], [None; 9]);
            for quantity in 0..QUANTITIES.len() {
                let values: Vec<f64> = group.iter().filter_map(|e| e.quantities()[quantity]).collect();
                let count = values.len() as f64;
                if values.is_empty() {
                    continue;
                }
                let mean = values.iter().sum::<f64>() / count;
                means[quantity] = Some(mean);
                if values.len() > 1 {
                    let squares = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
                    sds[quantity] = Some(libm::sqrt(squares / (count - 1.0)));
                }
            }
            ConditionEstimate {
                condition: group[0].condition.clone(),
                velocity_rad_s: group[0].velocity_rad_s,
                torque_nm: group[0].torque_nm,
                repetitions: group.len(),
                mean: means,
                sd: sds,
            }
        })
        .collect()
}
