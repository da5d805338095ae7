//! The result of a fit by trial and by condition: what tables and files show.

use serde::Serialize;

use crate::fit::data::preprocessing::{Observations, TrialObservation};
use crate::fit::fitted::fit::{Fit, X_E};
use crate::fit::fitted::uncertainty::{predictions, uncertainties, variance_accounted_for};
use crate::fit::inference::profile::{ProfileInterval, profiles};
use crate::fit::solver::levenberg_marquardt::Termination;
use crate::wrist::{BASE_PARAMETERS, SimulationSettings, TraceSample, srs_period_s, substeps, trace};

/// What was estimated from one trial.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct TrialEstimate {
    /// Number of the trial in the session.
    pub trial: u32,
    /// Label of its condition, where the session has labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// Which repetition.
    pub repetition: u32,
    /// The six parameters, in the order of [`BASE_PARAMETERS`].
    pub values: [f64; 6],
    /// k_srs - k_dec, N m/rad.
    pub k_after_nm_per_rad: f64,
    /// SRS period, s; absent if the joint does not reach the elastic limit within the record.
    pub x_t_s: Option<f64>,
    /// Variance of the torque accounted for (Eq. 8).
    pub vaf: f64,
    /// Eq. 9 relative to each parameter.
    pub sem: [Option<f64>; 6],
    /// Standard error from the measured noise, relative to each parameter; absent where the data do not tell.
    pub se: [Option<f64>; 6],
    /// 95 % profile likelihood intervals of k_dec and x_e ([`crate::fit::PROFILED_PARAMETERS`]); absent where they are not a trial's own.
    #[serde(skip)]
    pub profile: [Option<ProfileInterval>; 2],
    /// Whether the optimisation came to its end.
    pub converged: bool,
    /// Remarks for a person: what stopped it, parameters at a bound, other optima.
    pub remarks: Vec<String>,
}

/// The repetitions of one condition together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConditionEstimate {
    /// Its label, where the session has labels.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub condition: Option<String>,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
    /// How many repetitions.
    pub repetitions: usize,
    /// Means over the repetitions, in the order of [`QUANTITIES`]; absent where no repetition has a value.
    pub mean: [Option<f64>; 9],
    /// Standard deviations; absent with fewer than two values.
    pub sd: [Option<f64>; 9],
}

/// What tables show of a trial: the six parameters and what follows from them.
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

impl TrialEstimate {
    /// Its values in the order of [`QUANTITIES`].
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

/// The estimates of all trials, by condition and repetition.
pub fn estimates(observations: &Observations, fit: &Fit) -> Vec<TrialEstimate> {
    with_profiles(observations, fit, &profiles(observations, fit))
}

/// The same without profiles, which cost more than all else and which no table of a study has.
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
        values.copy_from_slice(&fit.parameters[index][..6]);
        TrialEstimate {
            trial: trial.number,
            condition: trial.label.clone(),
            velocity_rad_s: trial.velocity_rad_s,
            torque_nm: trial.torque_nm,
            repetition: trial.repetition,
            k_after_nm_per_rad: values[3] - values[4],
            x_t_s: fit.x_t_s(observations, index),
            vaf: variance_accounted_for(&trial.measured_nm, &predictions[index].residual_nm),
            sem: uncertainties[index].sem,
            se: uncertainties[index].se,
            profile: profiles[index],
            converged: fit.outcome(index).stop == Termination::Converged,
            remarks: remarks(fit, index),
            values,
        }
    };
    (0..observations.trials.len()).map(of_trial).collect()
}

impl Fit {
    /// SRS period of a trial, s; absent if the joint does not reach the elastic limit within the record.
    pub fn x_t_s(&self, observations: &Observations, trial: usize) -> Option<f64> {
        srs_period_s(&simulated(observations, self, trial), self.parameters[trial][X_E])
    }
}

/// The wrist during a trial as the fit sees it, for as long as the record was kept.
pub fn simulated(observations: &Observations, fit: &Fit, index: usize) -> Vec<TraceSample> {
    let trial: &TrialObservation = &observations.trials[index];
    let parameters = &fit.parameters[index];
    let substeps = substeps(observations.lever, parameters, observations.period_s);
    let samples = trial.input.motion.len() - trial.input.onset;
    let request = SimulationSettings { samples, ..observations.request(&fit.kinds, substeps) };
    trace(&request, &trial.input, parameters)
}

fn remarks(fit: &Fit, index: usize) -> Vec<String> {
    let mut remarks = Vec::new();
    match fit.outcome(index).stop {
        Termination::Converged => {}
        Termination::Stalled => {
            remarks.push("not converged: no step improves the fit, the problem is flat or singular".into())
        }
        Termination::Iterations => remarks.push("not converged: the iterations allowed were used up".into()),
        Termination::NotFinite => {
            remarks.push("not converged: the model cannot be evaluated at the first values".into())
        }
    }
    for (parameter, name) in BASE_PARAMETERS.iter().enumerate() {
        if fit.at_bound(index, parameter) {
            remarks.push(format!("{name} ended at its bound: the data do not determine it"));
        }
    }
    let own = &fit.parameters[index];
    if own[4] > own[3] {
        remarks.push(
            "k_after is below zero: beyond the elastic limit the torque falls, which a stiffness cannot explain".into(),
        );
    }
    if fit.ambiguous_trials.contains(&index) {
        remarks.push("another optimum with a different x_e fits as well within the noise".into());
    }
    remarks
}

/// Means and standard deviations over the repetitions of each condition.
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
