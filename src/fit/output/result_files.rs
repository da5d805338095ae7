//! Result files of a fit: `fit.csv`, `conditions.csv` and `fit.json`.

use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use super::estimates::{ConditionEstimate, TrialEstimate, by_condition, estimates};
use crate::dataset::Disk;
use crate::fit::data::observations::{ExcludedTrial, Observations};
use crate::fit::data::preprocessing::PreprocessingSettings;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::quantities::QUANTITIES;
use crate::fit::inference::bootstrap::{BOOTSTRAPPED_QUANTITIES, BootstrapSpread};
use crate::fit::inference::profile::{PROFILED_PARAMETERS, ProfileInterval};
use crate::fit::model::specification::Model;
use crate::fit::residuals::objective::{Objective, Weighting};
use crate::signal::NoiseCovariance;
use crate::wrist::BASE_PARAMETERS;

/// Version of the format of `fit.json` that this program writes.
pub const FIT_FORMAT: &str = "ramphold-fit/1";

/// Results of a fit together with its settings: the contents of the result files.
#[derive(Debug, Clone)]
pub struct Results {
    /// Id of the subject.
    pub subject: String,
    /// Settings of the preprocessing.
    pub settings: PreprocessingSettings,
    /// Weighting that was asked for.
    pub weighting: Weighting,
    /// Estimates of the trials, ordered by condition and repetition.
    pub estimates: Vec<TrialEstimate>,
    /// Means over the repetitions of each condition.
    pub conditions: Vec<ConditionEstimate>,
    /// Contents of `fit.json`: estimates, uncertainties, settings and versions.
    pub json: Value,
}

impl Results {
    /// Collects the results of `fit`.
    pub fn new(
        subject: &str,
        observations: &Observations,
        fit: &Fit,
        settings: PreprocessingSettings,
        weighting: Weighting,
    ) -> Self {
        let estimates = estimates(observations, fit);
        let conditions = by_condition(&estimates);
        let json = json(subject, observations, fit, settings, weighting, (&estimates, &conditions));
        Self { subject: subject.into(), settings, weighting, estimates, conditions, json }
    }

    /// Adds the results of a parametric bootstrap with `refits` simulated sessions; `spread` has one entry per trial.
    pub fn add_bootstrap(&mut self, refits: usize, seed: u64, spread: &[BootstrapSpread]) {
        self.json["settings"]["bootstrap"] = json!({ "refits": refits, "seed": seed });
        let trials = self.json["trials"].as_array_mut().into_iter().flatten();
        for (trial, own) in trials.zip(spread) {
            let named = (0..BOOTSTRAPPED_QUANTITIES.len()).map(|quantity| {
                let found = json!({ "sd": own.sd[quantity], "percentiles_95": own.percentiles[quantity] });
                (BOOTSTRAPPED_QUANTITIES[quantity].to_string(), found)
            });
            trial["bootstrap"] = named.collect::<Map<_, _>>().into();
        }
    }

    /// Whether the optimisation converged for every trial.
    pub fn all_converged(&self) -> bool {
        self.estimates.iter().all(|estimate| estimate.converged)
    }

    /// Writes the three result files into `folder`; each file is replaced atomically.
    ///
    /// # Errors
    /// If a file cannot be written; the message names the file.
    pub fn write(&self, disk: &Disk, folder: &Path) -> Result<(), WriteError> {
        let json = serde_json::to_string_pretty(&self.json).unwrap_or_default() + "\n";
        let files = [
            ("fit.csv", fit_csv(&self.estimates)),
            ("conditions.csv", conditions_csv(&self.conditions)),
            ("fit.json", json),
        ];
        write_files(disk, folder, &files.each_ref().map(|(name, text)| (*name, text.as_str())))
    }
}

/// Writes files, given as name and text, into `folder`, which is created if it does not exist; each file is replaced atomically.
///
/// # Errors
/// If the folder or a file cannot be written; the message names the path.
pub fn write_files(disk: &Disk, folder: &Path, files: &[(&str, &str)]) -> Result<(), WriteError> {
    std::fs::create_dir_all(folder).map_err(|source| WriteError { path: folder.into(), source })?;
    for (name, text) in files {
        let path = folder.join(name);
        disk.write(&path, text.as_bytes()).map_err(|source| WriteError { path, source })?;
    }
    Ok(())
}

/// Failure to write a result file.
#[derive(Debug, thiserror::Error)]
#[error("{}: cannot be written: {source}", path.display())]
pub struct WriteError {
    path: PathBuf,
    source: std::io::Error,
}

/// A number as a cell of a CSV table; empty without a value or if the value is not finite.
fn cell(value: Option<f64>) -> String {
    value.filter(|x| x.is_finite()).map_or(String::new(), |x| x.to_string())
}

/// Header of `fit.csv` without the column of condition labels, which only some sessions have.
pub fn fit_header() -> String {
    let mut text = format!("velocity_rad_s,torque_nm,repetition,{}", QUANTITIES.join(","));
    for prefix in ["sem", "se"] {
        for name in BASE_PARAMETERS {
            text += &format!(",{prefix}_{name}");
        }
    }
    text + ",trial,converged"
}

/// Row of a trial under [`fit_header`].
pub fn fit_row(estimate: &TrialEstimate) -> String {
    let mut text = format!("{},{},{}", estimate.velocity_rad_s, estimate.torque_nm, estimate.repetition);
    for value in estimate.quantities().into_iter().chain(estimate.sem).chain(estimate.se) {
        text += ",";
        text += &cell(value);
    }
    text + &format!(",{},{}", estimate.trial, estimate.converged)
}

/// Text of `fit.csv`.
fn fit_csv(estimates: &[TrialEstimate]) -> String {
    let labelled = estimates.iter().any(|estimate| estimate.condition.is_some());
    let mut text = fit_header() + if labelled { ",condition\n" } else { "\n" };
    for estimate in estimates {
        text += &fit_row(estimate);
        if labelled {
            text += &format!(",{}", quoted(estimate.condition.as_deref().unwrap_or("")));
        }
        text += "\n";
    }
    text
}

/// A text as a cell of a CSV table, in quotes if necessary.
fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n']) { format!("\"{}\"", text.replace('"', "\"\"")) } else { text.into() }
}

/// Text of `conditions.csv`.
fn conditions_csv(conditions: &[ConditionEstimate]) -> String {
    let mut text = "velocity_rad_s,torque_nm,repetitions".to_string();
    for name in QUANTITIES {
        text += &format!(",{name},sd_{name}");
    }
    let labelled = conditions.iter().any(|condition| condition.condition.is_some());
    text += if labelled { ",condition\n" } else { "\n" };
    for condition in conditions {
        text += &format!("{},{},{}", condition.velocity_rad_s, condition.torque_nm, condition.repetitions);
        for (mean, sd) in condition.mean.iter().zip(condition.sd) {
            text += &format!(",{},{}", cell(*mean), cell(sd));
        }
        if labelled {
            text += &format!(",{}", quoted(condition.condition.as_deref().unwrap_or("")));
        }
        text += "\n";
    }
    text
}

/// Contents of `fit.json`.
fn json(
    subject: &str,
    observations: &Observations,
    fit: &Fit,
    settings: PreprocessingSettings,
    weighting: Weighting,
    (estimates, conditions): (&[TrialEstimate], &[ConditionEstimate]),
) -> Value {
    let named = |values: &[Option<f64>], names: &[&str]| -> Value {
        names
            .iter()
            .zip(values)
            .map(|(name, value)| ((*name).to_string(), json!(value)))
            .collect::<Map<_, _>>()
            .into()
    };
    let trial = |estimate: &TrialEstimate| {
        let mut entry = Map::new();
        entry.insert("trial".into(), json!(estimate.trial));
        if let Some(label) = &estimate.condition {
            entry.insert("condition".into(), json!(label));
        }
        entry.insert("velocity_rad_s".into(), json!(estimate.velocity_rad_s));
        entry.insert("torque_nm".into(), json!(estimate.torque_nm));
        entry.insert("repetition".into(), json!(estimate.repetition));
        entry.insert("values".into(), named(&estimate.quantities(), &QUANTITIES));
        entry.insert("sem_eq9_relative".into(), named(&estimate.sem, &BASE_PARAMETERS));
        entry.insert("se_relative".into(), named(&estimate.se, &BASE_PARAMETERS));
        entry.insert("profile_95".into(), profile_json(&estimate.profile));
        entry.insert("converged".into(), json!(estimate.converged));
        entry.insert("remarks".into(), json!(estimate.remarks));
        Value::Object(entry)
    };
    let condition = |condition: &ConditionEstimate| {
        json!({
            "condition": condition.condition,
            "velocity_rad_s": condition.velocity_rad_s,
            "torque_nm": condition.torque_nm,
            "repetitions": condition.repetitions,
            "mean": named(&condition.mean, &QUANTITIES),
            "sd": named(&condition.sd, &QUANTITIES),
        })
    };
    let noise = |noise: &NoiseCovariance| {
        json!({
            "stretches": noise.stretches,
            "last_sample_sd_nm": noise.last_sample_sd_nm(),
            "effective_samples": noise.effective_samples(),
        })
    };
    let left_out = |left: &ExcludedTrial| json!({ "trial": left.trial, "reason": left.reason });
    json!({
        "format": FIT_FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "subject": subject,
        "settings": {
            "window_s": settings.window_s,
            "filter": if observations.sections.is_empty() { Value::Null } else { json!(settings.filter) },
            "weighting": weighting_used(weighting, fit),
            "lever": observations.lever,
            "sample_rate_hz": 1.0 / observations.period_s,
        },
        "model": model_json(&fit.model),
        "mechanism_values": mechanism_values(fit),
        "components": fit.solution.outcomes.iter().map(|outcome| json!({
            "cost": outcome.cost, "stop": outcome.termination, "iterations": outcome.iterations,
        })).collect::<Vec<_>>(),
        "noise_source": observations.noise_source,
        "noise": observations.noise_covariances.iter().map(noise).collect::<Vec<_>>(),
        "angle_noise_rad": observations.angle_noise_rad,
        "trials": estimates.iter().map(trial).collect::<Vec<_>>(),
        "conditions": conditions.iter().map(condition).collect::<Vec<_>>(),
        "left_out": observations.excluded_trials.iter().map(left_out).collect::<Vec<_>>(),
    })
}

/// Profile likelihood intervals as JSON; an end beyond the bound of the parameter is null.
fn profile_json(profile: &[Option<ProfileInterval>; 2]) -> Value {
    let named = PROFILED_PARAMETERS.iter().zip(profile).map(|(parameter, interval)| {
        let ends = interval.map(|own| json!([own.low, own.high]));
        (BASE_PARAMETERS[*parameter].to_string(), json!(ends))
    });
    named.collect::<Map<_, _>>().into()
}

/// The weighting that the fit used: residuals stay unweighted if no noise could be estimated.
fn weighting_used(asked: Weighting, fit: &Fit) -> Weighting {
    match fit.objective {
        Objective::LeastSquares => Weighting::Plain,
        Objective::Whitened(_) => asked,
    }
}

fn model_json(model: &Model) -> Value {
    serde_json::from_str(&model.to_json(None)).unwrap_or(Value::Null)
}

/// Parameters of mechanisms that have the same value in all trials, by name.
fn mechanism_values(fit: &Fit) -> Value {
    let names = fit.model.parameter_names();
    let Some(first) = fit.parameters.first() else { return Value::Null };
    (BASE_PARAMETERS.len()..names.len())
        .filter(|index| fit.parameters.iter().all(|own| own[*index] == first[*index]))
        .map(|index| (names[index].clone(), json!(first[index])))
        .collect::<Map<_, _>>()
        .into()
}
