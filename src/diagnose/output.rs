//! Writes `diagnosis.json` and `model.json`, and draws the residuals for the terminal.

use serde_json::{Map, Value, json};

use super::across_trials::covariate_regression::without_effect;
use super::across_trials::elastic_limit_law::ElasticLimitLaw;
use super::cause::{AlternativeCause, Cause, CauseEvidence};
use super::diagnosis::Diagnosis;
use super::evidence::answer::CauseProbabilities;
use super::evidence::found_law::{FoundLaw, LawCheck};
use super::interval::Interval;
use super::predicted_torque::residuals;
use super::residual_correlation::residual_by_trial;
use crate::dataset::Disk;
use crate::files::Folder;
use crate::fit::{AddedMechanism, Fit, K_SRS, Model, Observations, ParameterSpec, WriteError, write_files};
use crate::json_file;
use crate::statistics::group_indices;
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::{EvidenceSource, MechanismKind};

/// Format and version of `diagnosis.json`.
pub const DIAGNOSIS_FORMAT: &str = "ramphold-diagnosis/1";

impl Diagnosis {
    /// The contents of `diagnosis.json`.
    pub fn to_json(&self, observations: &Observations) -> Value {
        json!({
            "format": DIAGNOSIS_FORMAT,
            "version": env!("CARGO_PKG_VERSION"),
            "verdict": self.verdict,
            "misfit": {
                "statistic": self.misfit.largest.max(self.misfit.excess),
                "p_value": self.p_value,
                "largest_score": self.misfit.largest,
                "pattern_excess": self.misfit.excess,
                "residual_variance_over_noise": self.misfit.scatter,
            },
            "causes": self.causes.iter().map(|cause| self.cause(observations, cause)).collect::<Vec<_>>(),
            "probabilities": self.probabilities.as_ref().map(CauseProbabilities::to_json),
            "none_of_these": self.probabilities.as_ref().map(|own| own.none_of_these),
            "left_over": { "p_value": self.remaining_p_value },
            "free_law": self.free_law.as_ref().map(FoundLaw::to_json),
            "residual_term": self.residual_term,
            "not_visible": self.undetectable.iter().map(|undetectable| json!({
                "mechanism": undetectable.kind.id(), "class": undetectable.kind.class(), "reason": undetectable.reason,
            })).collect::<Vec<_>>(),
            "laws": { "elastic_limit": self.elastic_limit_law.as_ref().map(ElasticLimitLaw::to_json) },
            "residual_by_trial": residual_by_trial(observations, &self.before, &self.after),
            "residual_map": residual_map(observations, &self.before, &self.after),
            "remarks": self.remarks,
        })
    }

    fn cause(&self, observations: &Observations, cause: &Cause) -> Value {
        let mut entry = Map::new();
        entry.insert("mechanism".into(), json!(cause.kind.id()));
        entry.insert("title".into(), json!(cause.kind.title()));
        entry.insert("class".into(), json!(cause.kind.class()));
        entry.insert("probability".into(), json!(cause.probability));
        entry.insert("parameters".into(), parameters(observations, cause));
        entry.insert("p_value".into(), json!(cause.p_value));
        let ids: Vec<&str> = cause.alternatives.iter().map(|own| own.kind.id()).collect();
        entry.insert("indistinguishable".into(), json!(ids));
        let alternatives: Vec<Value> =
            cause.alternatives.iter().map(|own| self.alternative(observations, own)).collect();
        entry.insert("alternatives".into(), json!(alternatives));
        entry.insert("law".into(), json!(cause.law.as_ref().map(LawCheck::to_json)));
        match &cause.evidence {
            CauseEvidence::WithinTrial { before, after, chi_square_gain, gain } => {
                entry.insert("worth_chi_square".into(), json!(chi_square_gain));
                entry.insert("gain".into(), json!(gain));
                entry.insert("parameter_shift".into(), shift(observations, before, after));
            }
            CauseEvidence::Hold { before, after, gain, .. } => {
                entry.insert("gain".into(), json!(gain));
                entry.insert("parameter_shift".into(), shift(observations, before, after));
            }
            CauseEvidence::RigTrials { before, after, deviation_sds } => {
                entry.insert("deviation_sds".into(), json!(deviation_sds));
                // The fit beside this diagnosis has the constant as measured.
                entry.insert("corrected".into(), json!(true));
                entry.insert("parameter_shift".into(), shift(observations, before, after));
            }
            CauseEvidence::AcrossTrials(covariate_effect) => {
                let ratio = covariate_effect.left_out_ratio;
                entry.insert(
                    "gain".into(),
                    json!({ "held_out_rmse_ratio": { "value": ratio, "low": null, "high": null },
                            "of": "the trials' k_srs about the other repetitions" }),
                );
                let shift = stiffness_shift(observations, &self.before, cause.kind, &cause.values);
                entry.insert("parameter_shift".into(), shift);
            }
            CauseEvidence::Outliers(outliers) => {
                let trials: Vec<Value> = outliers
                    .iter()
                    .map(|o| json!({ "trial": observations.trials[o.trial].number, "k_srs_ratio": o.ratio }))
                    .collect();
                entry.insert("trials".into(), json!(trials));
                entry.insert("parameter_shift".into(), json!({}));
            }
        }
        Value::Object(entry)
    }

    /// A candidate in place of a cause: what it would be, and how the parameters would change with it.
    fn alternative(&self, observations: &Observations, own: &AlternativeCause) -> Value {
        let shift = match &own.fits {
            Some(fits) => shift(observations, &fits.0, &fits.1),
            None if own.kind.evidence() == EvidenceSource::AcrossTrials => {
                stiffness_shift(observations, &self.before, own.kind, &own.values)
            }
            None => json!({}),
        };
        json!({
            "mechanism": own.kind.id(),
            "title": own.kind.title(),
            "class": own.kind.class(),
            "probability": own.probability,
            "parameters": named(own.kind, &own.values),
            "parameter_shift": shift,
        })
    }
}

/// Parameters of a cause with their 95 % intervals.
fn parameters(observations: &Observations, cause: &Cause) -> Value {
    if let CauseEvidence::Outliers(outliers) = &cause.evidence {
        let trials: Vec<u32> = outliers.iter().map(|own| observations.trials[own.trial].number).collect();
        return json!({ "trials": { "value": trials } });
    }
    named(cause.kind, &cause.values)
}

/// The values of a mechanism's parameters by their names.
fn named(kind: MechanismKind, values: &[Interval]) -> Value {
    let named = kind.parameters().iter().zip(values);
    named.map(|(parameter, own)| (parameter.name.to_string(), json!(own))).collect::<Map<_, _>>().into()
}

/// Means over trials of the base parameters and of x_t without and with the added mechanism, of those that some trial determines in
/// both.
fn shift(observations: &Observations, before: &Fit, after: &Fit) -> Value {
    let mean = |all: Vec<f64>| (!all.is_empty()).then(|| all.iter().sum::<f64>() / all.len() as f64);
    let mean_of = |fit: &Fit, parameter: usize| {
        let determined = (0..fit.parameters.len()).filter(|trial| !fit.at_bound(*trial, parameter));
        mean(determined.map(|trial| fit.parameters[trial][parameter]).collect())
    };
    let period = |fit: &Fit| {
        mean((0..fit.parameters.len()).filter_map(|trial| fit.x_t_s(observations, trial)).collect())
    };
    let mut entry = Map::new();
    let mut insert = |name: &str, from: Option<f64>, to: Option<f64>| {
        if let (Some(from), Some(to)) = (from, to) {
            entry.insert(name.into(), json!({ "before": from, "after": to }));
        }
    };
    for (parameter, name) in BASE_PARAMETERS.iter().enumerate() {
        insert(name, mean_of(before, parameter), mean_of(after, parameter));
    }
    insert("x_t_s", period(before), period(after));
    Value::Object(entry)
}

/// Mean of k_srs as fitted, and with the effect of the mechanism removed from each trial.
fn stiffness_shift(
    observations: &Observations,
    fit: &Fit,
    kind: MechanismKind,
    values: &[Interval],
) -> Value {
    let count = fit.parameters.len() as f64;
    let values: Vec<f64> = values.iter().map(|own| own.value).collect();
    let (mut before, mut after) = (0.0, 0.0);
    for (trial, own) in fit.parameters.iter().enumerate() {
        before += own[K_SRS] / count;
        after += without_effect(observations, fit, trial, kind, &values) / count;
    }
    json!({ "k_srs_nm_per_rad": { "before": before, "after": after } })
}

/// Mean residual over time of each condition, with its noise band, without and with the added mechanisms.
fn residual_map(observations: &Observations, before: &Fit, after: &Fit) -> Value {
    let step = observations.samples.div_ceil(50);
    let samples: Vec<usize> = (0..observations.samples).step_by(step).collect();
    let (first, second) = (residuals(observations, before), residuals(observations, after));
    let conditions = group_indices(observations.trials.len(), |trial| observations.trials[trial].condition);
    let rows: Vec<Value> = conditions
        .values()
        .map(|trials| {
            let count = trials.len() as f64;
            let mean =
                |of: &[Vec<f64>], sample: usize| trials.iter().map(|t| of[*t][sample]).sum::<f64>() / count;
            let own = &observations.trials[trials[0]];
            let noise =
                observations.noise_index[trials[0]].map(|index| &observations.noise_covariances[index]);
            let band = |sample: usize| {
                let noise = noise?;
                let places: Vec<usize> = observations.noise_samples().collect();
                let place = places.iter().position(|place| *place >= sample)?;
                Some(libm::sqrt(noise.covariance[(place, place)] / count))
            };
            json!({
                "velocity_rad_s": own.velocity_rad_s,
                "torque_nm": own.torque_nm,
                "condition": own.label,
                "trials": trials.len(),
                "mean_nm": samples.iter().map(|s| mean(&first, *s)).collect::<Vec<_>>(),
                "sd_nm": samples.iter().map(|s| band(*s)).collect::<Vec<_>>(),
                "after_nm": samples.iter().map(|s| mean(&second, *s)).collect::<Vec<_>>(),
            })
        })
        .collect();
    json!({
        "time_s": samples.iter().map(|s| *s as f64 * observations.period_s).collect::<Vec<_>>(),
        "conditions": rows,
    })
}

/// Draws the mean residual of each condition over time as a line of block characters, without and with the added
/// mechanisms.
pub fn picture(map: &Value) -> String {
    const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    let rows: Vec<&Value> = map["conditions"].as_array().into_iter().flatten().collect();
    let all = rows.iter().flat_map(|row| numbers(&row["mean_nm"]));
    let largest = all.map(f64::abs).fold(1e-9, f64::max);
    let line = |values: Vec<f64>| -> String {
        let block = |x: f64| BLOCKS[(((x / largest + 1.0) / 2.0 * 7.0) + 0.5).clamp(0.0, 7.0) as usize];
        values.into_iter().map(block).collect()
    };
    let mut text = format!(
        "mean residual over the window, full scale +-{:.1} mN m; without | with the added mechanisms\n",
        largest * 1e3
    );
    for row in rows {
        let label = row["condition"].as_str().map_or_else(
            || {
                format!(
                    "{:>5.2} rad/s {:>4.1} N m",
                    row["velocity_rad_s"].as_f64().unwrap_or(0.0),
                    row["torque_nm"].as_f64().unwrap_or(0.0)
                )
            },
            |label| format!("{label:>18}"),
        );
        text +=
            &format!("{label}  {} | {}\n", line(numbers(&row["mean_nm"])), line(numbers(&row["after_nm"])));
    }
    text
}

impl Diagnosis {
    /// The base model with the named mechanisms fixed at their values; `fit`, `run` and `diagnose` accept it.
    pub fn model(&self, observations: &Observations) -> Model {
        let mut model = self.after.model.clone();
        let ranges = model.mechanism_ranges();
        for (added, range) in model.mechanisms.iter_mut().zip(ranges) {
            for (spec, value) in added.parameters.iter_mut().zip(&self.after.parameters[0][range]) {
                *spec = ParameterSpec::fixed(*value);
            }
        }
        for cause in &self.causes {
            if !matches!(cause.evidence, CauseEvidence::AcrossTrials(_) | CauseEvidence::Hold { .. }) {
                continue;
            }
            let parameters = cause.values.iter().map(|own| ParameterSpec::fixed(own.value)).collect();
            model.mechanisms.push(AddedMechanism { kind: cause.kind, parameters });
        }
        debug_assert_eq!(observations.trials.len(), self.after.parameters.len());
        model
    }

    /// Writes `diagnosis.json` and `model.json` into `folder`.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn write(
        &self,
        observations: &Observations,
        json: &Value,
        disk: &Disk,
        folder: &Folder,
    ) -> Result<(), WriteError> {
        let text = json_file::pretty(json);
        let model =
            self.model(observations).to_json(Some("base model and the mechanisms that a diagnosis named"));
        write_files(disk, folder, &[("diagnosis.json", &text), ("model.json", &model)])
    }
}
