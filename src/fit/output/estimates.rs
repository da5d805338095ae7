//! Estimates by trial and by condition, as tables and files report them.

use serde::Serialize;

use crate::fit::calibration::constant_effects::ConstantEffects;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::{predictions, variance_accounted_for};
use crate::fit::fitted::quantities::QUANTITIES;
use crate::fit::fitted::uncertainty::uncertainties;
use crate::fit::inference::profile::{ProfileInterval, profiles};
use crate::fit::model::parameter_index::{K_DEC, K_SRS, X_E};
use crate::fit::population::other_optimum::OtherOptimum;
use crate::fit::population::session_fit::SessionFit;
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
    /// Part of `se` that comes from the errors of the measured constants of the rig; zero without a calibration, `None` if there is one and
    /// the part cannot be computed, where `se` is `None` too.
    #[serde(skip)]
    pub se_of_rig: [Option<f64>; 6],
    /// 95 % profile likelihood intervals of k_dec and x_e; `None` if the parameter is not the trial's own, or not computed.
    #[serde(skip)]
    pub profile: [Option<ProfileInterval>; 2],
    /// Whether the data determine each base parameter; one that ended at a bound is not a number to average.
    #[serde(skip)]
    pub determined: [bool; 6],
    /// Other optima that the data do not rule out, the most probable first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub other_optima: Vec<OtherOptimum>,
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
    /// Number of repetitions that have a value and are in the mean, in the order of [`QUANTITIES`].
    #[serde(skip)]
    pub averaged: [usize; 9],
    /// Standard errors of the means of the six base parameters, relative to them; `None` if a repetition has none.
    pub se: [Option<f64>; 6],
    /// Part of `se` that comes from the errors of the measured constants of the rig; zero without a calibration, `None` if there is one and
    /// the part cannot be computed, where `se` is `None` too.
    #[serde(skip)]
    pub se_of_rig: [Option<f64>; 6],
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

    /// The same without those that rest on a parameter that the data do not determine.
    pub fn determined_quantities(&self) -> [Option<f64>; 9] {
        let mut quantities = self.quantities();
        for (parameter, is_determined) in self.determined.iter().enumerate() {
            quantities[parameter] = quantities[parameter].filter(|_| *is_determined);
        }
        quantities[6] = quantities[6].filter(|_| self.determined[K_SRS] && self.determined[K_DEC]);
        quantities[7] = quantities[7].filter(|_| self.determined[X_E]);
        quantities
    }
}

/// Optima of at least this probability are reported: the others are beyond the 95 % that an interval holds.
const REPORTED_PROBABILITY: f64 = 0.05;

/// Estimates of all trials with profile likelihood intervals, ordered by condition and repetition.
pub fn estimates(observations: &Observations, fit: &Fit) -> Vec<TrialEstimate> {
    with_profiles(observations, fit, &profiles(observations, fit))
}

/// Estimates of all trials without profile likelihood intervals, which take longer than everything else and are not part of a study.
pub fn estimates_without_profiles(observations: &Observations, fit: &Fit) -> Vec<TrialEstimate> {
    with_profiles(observations, fit, &vec![[None; 2]; observations.trials.len()])
}

/// Estimates of all trials and conditions from the fit of the session as a whole: standard errors are those of the joint posterior.
pub fn session_estimates(
    observations: &Observations,
    session: &SessionFit,
) -> (Vec<TrialEstimate>, Vec<ConditionEstimate>) {
    let mut estimates = estimates_without_profiles(observations, &session.fit);
    for (trial, estimate) in estimates.iter_mut().enumerate() {
        for (parameter, se) in estimate.se.iter_mut().enumerate() {
            if estimate.determined[parameter] {
                *se = session.log_covariance(parameter, trial, trial).map(libm::sqrt).or(*se);
            }
        }
        let others = session.other_optima[trial].iter();
        estimate.other_optima =
            others.filter(|other| other.probability >= REPORTED_PROBABILITY).cloned().collect();
        estimate.remarks = remarks(observations, &session.fit, trial, estimate);
    }
    let covariance =
        |parameter: usize, one: usize, other: usize| session.log_covariance(parameter, one, other);
    let conditions = conditions_with(&estimates, covariance);
    (estimates, conditions)
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
        let mut estimate = TrialEstimate {
            trial: trial.number,
            condition: trial.label.clone(),
            velocity_rad_s: trial.velocity_rad_s,
            torque_nm: trial.torque_nm,
            repetition: trial.repetition,
            k_after_nm_per_rad: values[K_SRS] - values[K_DEC],
            x_t_s: fit.x_t_s(observations, index),
            vaf: variance_accounted_for(
                observations.torque_of(&trial.measured_nm),
                observations.torque_of(&predictions[index].residual_nm),
            ),
            sem: uncertainties[index].sem,
            se: uncertainties[index].se,
            se_of_rig: [Some(0.0); 6],
            profile: profiles[index],
            determined: std::array::from_fn(|parameter| !fit.at_bound(index, parameter)),
            converged: fit.outcome(index).termination == Termination::Converged,
            remarks: Vec::new(),
            other_optima: other_optima(fit, index),
            values,
        };
        estimate.remarks = remarks(observations, fit, index, &estimate);
        estimate
    };
    (0..observations.trials.len()).map(of_trial).collect()
}

/// Other optima of a trial that the data do not rule out, if all values of the parameters are equally probable beforehand.
fn other_optima(fit: &Fit, trial: usize) -> Vec<OtherOptimum> {
    let others: Vec<_> = fit
        .other_optima
        .iter()
        .filter(|other| other.trials == [trial])
        .map(|other| {
            let mut coordinates = fit.solution.coordinates.clone();
            for (coordinate, value) in fit.block_coordinates(trial).iter().zip(&other.coordinates) {
                coordinates[*coordinate] = *value;
            }
            (fit.base_values(trial, &coordinates), libm::exp(-other.excess))
        })
        .collect();
    let sum = 1.0 + others.iter().map(|(_, weight)| weight).sum::<f64>();
    let optimum = |(values, weight): ([f64; 6], f64)| OtherOptimum { values, probability: weight / sum };
    others.into_iter().map(optimum).filter(|other| other.probability >= REPORTED_PROBABILITY).collect()
}

/// A stiffness beyond the elastic limit counts as below zero from this many standard errors on: with three, one session of 36 trials
/// in 20 has such a remark by chance.
const FALLING_STANDARD_ERRORS: f64 = 3.0;

/// Whether k_after = k_srs - k_dec is below zero beyond its standard error, from both stiffnesses and their relative standard errors.
/// Their errors rise and fall together, so that this standard error is rather too large.
pub fn torque_falls([k_srs, k_dec]: [f64; 2], se: [Option<f64>; 2]) -> bool {
    let [Some(srs), Some(dec)] = se else { return false };
    let (srs, dec) = (srs * k_srs, dec * k_dec);
    k_dec - k_srs > FALLING_STANDARD_ERRORS * libm::sqrt(srs * srs + dec * dec)
}

/// Remarks on a trial, as text for a reader.
fn remarks(observations: &Observations, fit: &Fit, index: usize, estimate: &TrialEstimate) -> Vec<String> {
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
    let window_s = observations.samples as f64 * observations.period_s;
    if estimate.x_t_s.is_none_or(|x_t_s| x_t_s >= window_s) {
        remarks.push(
            "the joint does not reach x_e within the window: k_dec and x_e follow from what is expected of them, and k_srs may be too large"
                .into(),
        );
    }
    let own = &fit.parameters[index];
    let is_determined = !fit.at_bound(index, K_SRS) && !fit.at_bound(index, K_DEC);
    if is_determined && torque_falls([own[K_SRS], own[K_DEC]], [estimate.se[K_SRS], estimate.se[K_DEC]]) {
        remarks.push(
            "k_after is below zero: beyond the elastic limit the torque falls, which a stiffness cannot explain".into(),
        );
    }
    for other in &estimate.other_optima {
        remarks.push(format!(
            "another optimum fits within the noise: x_e {:.4} rad, k_srs {:.1} N m/rad, k_dec {:.1} N m/rad (probability {:.0} %)",
            other.values[X_E],
            other.values[K_SRS],
            other.values[K_DEC],
            100.0 * other.probability
        ));
    }
    remarks
}

/// Estimates and conditions whose standard errors contain the errors of the rig's constants. Those of `estimates` and `conditions`, from
/// the noise alone, are independent of them. `effects` is `None` if the session has no fit with other constants: nothing is then known of the
/// standard errors, which would be too small without that part.
pub fn with_rig_errors(
    (mut estimates, mut conditions): (Vec<TrialEstimate>, Vec<ConditionEstimate>),
    effects: Option<&ConstantEffects>,
) -> (Vec<TrialEstimate>, Vec<ConditionEstimate>) {
    let together = |se: Option<f64>, of_rig: Option<f64>| Some(libm::hypot(se?, of_rig?));
    let of_rig = conditions_with(&estimates, |parameter, one, other| {
        Some(effects?.log_covariance(parameter, one, other))
    });
    let is_told =
        |parameter: usize, trial: usize| effects.is_some_and(|own| own.se(parameter, trial).is_some());
    let mut trials = 0..0;
    for (condition, of_rig) in conditions.iter_mut().zip(&of_rig) {
        trials = trials.end..trials.end + condition.repetitions;
        for (parameter, se) in condition.se.iter_mut().enumerate() {
            let mut averaged = trials.clone().filter(|trial| estimates[*trial].determined[parameter]);
            // A variance that is not finite though those of the trials are is one below zero by rounding.
            condition.se_of_rig[parameter] = averaged
                .all(|trial| is_told(parameter, trial))
                .then(|| of_rig.se[parameter].filter(|own| own.is_finite()).unwrap_or(0.0));
            *se = together(*se, condition.se_of_rig[parameter]);
        }
    }
    for (trial, estimate) in estimates.iter_mut().enumerate() {
        let had = estimate.se;
        for (parameter, se) in estimate.se.iter_mut().enumerate() {
            estimate.se_of_rig[parameter] = effects.and_then(|own| own.se(parameter, trial));
            *se = together(*se, estimate.se_of_rig[parameter]);
        }
        let lost =
            (0..BASE_PARAMETERS.len()).filter(|own| had[*own].is_some() && estimate.se[*own].is_none());
        let lost: Vec<&str> = lost.map(|own| BASE_PARAMETERS[own]).collect();
        if !lost.is_empty() {
            estimate.remarks.push(format!(
                "no standard error of {}: {}",
                lost.join(", "),
                match effects {
                    Some(_) => "what the errors of the calibration add to it is no finite number",
                    None => "the session has no fit with the calibration's constants one standard error smaller and larger",
                }
            ));
        }
    }
    (estimates, conditions)
}

/// Means and standard deviations over the repetitions of each condition; `estimates` are ordered by condition. The errors of trials
/// count as independent.
pub fn by_condition(estimates: &[TrialEstimate]) -> Vec<ConditionEstimate> {
    conditions_with(estimates, |parameter, one, other| {
        if one == other { estimates[one].se[parameter].map(|se| se * se) } else { Some(0.0) }
    })
}

/// Means and standard deviations over the repetitions of each condition; `estimates` are ordered by condition. `covariance` is that of
/// the logarithms of a parameter in two trials, given by index. Undetermined values are not averaged.
pub fn conditions_with(
    estimates: &[TrialEstimate],
    covariance: impl Fn(usize, usize, usize) -> Option<f64>,
) -> Vec<ConditionEstimate> {
    let same = |a: &TrialEstimate, b: &TrialEstimate| match (&a.condition, &b.condition) {
        (Some(a), Some(b)) => a == b,
        _ => a.velocity_rad_s == b.velocity_rad_s && a.torque_nm == b.torque_nm,
    };
    let mut first = 0;
    estimates
        .chunk_by(same)
        .map(|group| {
            let (mut means, mut sds, mut ses) = ([None; 9], [None; 9], [None; 6]);
            let mut averaged = [0; 9];
            for quantity in 0..QUANTITIES.len() {
                let values: Vec<(usize, f64)> = (first..)
                    .zip(group)
                    .filter_map(|(index, own)| Some((index, own.determined_quantities()[quantity]?)))
                    .collect();
                averaged[quantity] = values.len();
                let count = values.len() as f64;
                if values.is_empty() {
                    continue;
                }
                let mean = values.iter().map(|(_, value)| value).sum::<f64>() / count;
                means[quantity] = Some(mean);
                if values.len() > 1 {
                    let squares = values.iter().map(|(_, x)| (x - mean) * (x - mean)).sum::<f64>();
                    sds[quantity] = Some(libm::sqrt(squares / (count - 1.0)));
                }
                if quantity < BASE_PARAMETERS.len() {
                    let pairs = values.iter().flat_map(|one| values.iter().map(move |other| (one, other)));
                    let variance: Option<f64> =
                        pairs.map(|((i, a), (j, b))| Some(a * b * covariance(quantity, *i, *j)?)).sum();
                    ses[quantity] = variance.map(|own| libm::sqrt(own) / count / mean.abs());
                }
            }
            first += group.len();
            ConditionEstimate {
                condition: group[0].condition.clone(),
                velocity_rad_s: group[0].velocity_rad_s,
                torque_nm: group[0].torque_nm,
                repetitions: group.len(),
                mean: means,
                sd: sds,
                averaged,
                se: ses,
                se_of_rig: [Some(0.0); 6],
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stiffness_below_zero_within_its_error_is_no_finding() {
        let error = [Some(0.1), Some(0.1)];
        assert!(!torque_falls([15.0, 16.0], error), "1 N m/rad of a standard error of 2.2");
        assert!(torque_falls([15.0, 25.0], error));
        assert!(!torque_falls([15.0, 25.0], [Some(0.1), None]), "without a standard error nothing is known");
    }
}
