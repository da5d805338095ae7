//! Result files of a fit: `fit.csv`, `conditions.csv` and `fit.json`, and the tables of the fit of each trial on its own.

use std::path::PathBuf;

use serde_json::{Map, Value, json};

use super::estimates::{
    ConditionEstimate, TrialEstimate, by_condition, estimates, session_estimates, with_rig_errors,
};
use crate::dataset::{Disk, PROGRAM, RigCalibration, RigQuantity};
use crate::files::{Folder, csv_cell};
use crate::fit::calibration::asked_fit::AskedFit;
use crate::fit::calibration::assumed_constants::{ASSUMED_ERROR, assumed_constants};
use crate::fit::calibration::constant_effects::ConstantEffects;
use crate::fit::data::observations::{ExcludedTrial, Observations};
use crate::fit::data::preprocessing::{PreprocessingSettings, REFLEX_FREE_S};
use crate::fit::data::rig_constants::RigConstants;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::quantities::QUANTITIES;
use crate::fit::inference::bootstrap::{BOOTSTRAPPED_QUANTITIES, BootstrapSpread};
use crate::fit::inference::profile::{PROFILED_PARAMETERS, ProfileInterval};
use crate::fit::population::no_session_model::NoSessionModel;
use crate::fit::population::other_optimum::OtherOptimum;
use crate::fit::population::session_fit::SessionFit;
use crate::fit::residuals::objective::{Objective, Weighting};
use crate::json_file;
use crate::signal::NoiseCovariance;
use crate::wrist::{BASE_PARAMETERS, ScaledChannel};

/// Version of the format of `fit.json` that this program writes.
pub const FIT_FORMAT: &str = "ramphold-fit/1";

/// A model that accounts for less of the variance of every trial than this describes none of them.
pub const DESCRIBING_VAF: f64 = 0.5;

/// What a reader must know of a fit whose window, `window_s`, holds more than the time without reflexes: a reflex is then part of the
/// torque, and a model without one takes it for stiffness and yield. `None` where neither is so; `model` is the contents of a model file.
pub fn reflex_warning(window_s: f64, model: &Value) -> Option<String> {
    let has_reflex = model["mechanisms"]
        .as_array()
        .is_some_and(|own| own.iter().any(|own| own["mechanism"] == "stretch_reflex"));
    (window_s > REFLEX_FREE_S && !has_reflex).then(|| {
        format!(
            "the window of {:.0} ms is longer than the {:.0} ms in which no reflex acts (de Vlugt et al. 2011), and the model has no \
             reflex: what one adds to the torque is fitted as stiffness, damping and yield",
            1e3 * window_s,
            1e3 * REFLEX_FREE_S
        )
    })
}

/// Largest share of the variance that the model accounts for in a trial.
pub fn best_vaf(estimates: &[TrialEstimate]) -> f64 {
    estimates.iter().map(|estimate| estimate.vaf).fold(f64::NEG_INFINITY, f64::max)
}

/// What a reader must know of a fit that counts all samples alike, whether that was asked for or the noise is not known. `weighting` is that of
/// the settings in a file of results.
pub fn plain_warning(weighting: &Value) -> Option<&'static str> {
    (*weighting == json!(Weighting::Plain)).then_some(
        "all samples count alike, as in the paper: the filter leaves only some five independent values in a window, and noise then moves \
         the yield. k_srs of a trial can be twice and x_e half of what it is, with a VAF near 1",
    )
}

/// What a reader must know of a session that states onsets up to `late_s` after its motors have begun to move, or up to `early_s` before.
pub fn onset_warnings(late_s: f64, early_s: f64) -> Vec<String> {
    let own = |(by_s, side): (f64, &str)| {
        (by_s > 0.0).then(|| {
            format!(
                "onset_s in trials.csv is up to {:.1} ms {side} the motor begins to move: the analysis begins where it does",
                1e3 * by_s
            )
        })
    };
    [(late_s, "after"), (early_s, "before")].into_iter().filter_map(own).collect()
}

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
    /// The same of the fit of each trial on its own, the method of the paper.
    pub independent: (Vec<TrialEstimate>, Vec<ConditionEstimate>),
    /// Why the session has no model of its own, and `estimates` are those of each trial on its own.
    pub no_session_model: Option<NoSessionModel>,
    /// Contents of `fit.json`: estimates, uncertainties, settings and versions.
    pub json: Value,
}

impl Results {
    /// Collects the results of the fit of each trial on its own, and of the session as a whole or why there is none.
    pub fn new(
        subject: &str,
        observations: &Observations,
        (fit, session): (&Fit, &Result<SessionFit, NoSessionModel>),
        settings: PreprocessingSettings,
        weighting: Weighting,
        calibration: Option<&RigCalibration>,
    ) -> Self {
        let own = estimates(observations, fit);
        let conditions = by_condition(&own);
        let effects_on = |fit: AskedFit| ConstantEffects::new(observations, fit, calibration?);
        let of_fit = effects_on(AskedFit::Trials(fit));
        // Without a calibration the constants have no errors that are known of.
        let with_errors_of = |effects: Option<&ConstantEffects>, found| match calibration {
            Some(_) => with_rig_errors(found, effects),
            None => found,
        };
        let independent = with_errors_of(of_fit.as_ref(), (own, conditions));
        let ((estimates, conditions), chosen, effects) = match session {
            Ok(session) => {
                let effects = effects_on(AskedFit::Session(session));
                let found = with_errors_of(effects.as_ref(), session_estimates(observations, session));
                (found, &session.fit, effects)
            }
            Err(_) => (independent.clone(), fit, of_fit),
        };
        let mut json = json(subject, observations, chosen, settings, weighting, (&estimates, &conditions));
        json["session_model"] = session_model_json(session);
        let asked = session.as_ref().map_or(AskedFit::Trials(fit), AskedFit::Session);
        json["rig"] = rig_json(observations, asked, calibration);
        add_effects(&mut json, effects.as_ref());
        let trials = json["trials"].as_array_mut().into_iter().flatten();
        for (trial, own) in trials.zip(&independent.0) {
            trial["profile_95"] = profile_json(&own.profile);
            trial["independent"] = independent_json(own);
        }
        let no_session_model = session.as_ref().err().cloned();
        Self {
            subject: subject.into(),
            settings,
            weighting,
            estimates,
            conditions,
            independent,
            no_session_model,
            json,
        }
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

    /// Adds what the results were made from: the sum of the session, whether the fit of each trial alone was asked for, and the
    /// contradictions between signals and table that were accepted; `calibration` is the sum of the file of the rig's constants, if there
    /// was one.
    pub fn add_input(
        &mut self,
        digest: &str,
        independent: bool,
        accepted: &[impl serde::Serialize],
        calibration: Option<&str>,
    ) {
        self.json["made_from"] = json!({ "session_sha256": digest, "program": PROGRAM });
        self.json["settings"]["calibration_sha256"] = json!(calibration);
        self.json["settings"]["independent"] = json!(independent);
        // The weighting that was used depends on the data: without noise to measure there is only one.
        self.json["settings"]["weighting_asked"] = json!(self.weighting);
        self.json["accepted"] = json!(accepted);
    }

    /// Largest variance accounted for of any trial.
    pub fn best_vaf(&self) -> f64 {
        best_vaf(&self.estimates)
    }

    /// Whether the trials were fitted together.
    pub fn is_together(&self) -> bool {
        self.no_session_model.is_none()
    }

    /// Writes the result files into `folder`; each file is replaced atomically.
    ///
    /// # Errors
    /// If a file cannot be written; the message names the file.
    pub fn write(&self, disk: &Disk, folder: &Folder) -> Result<(), WriteError> {
        let json = json_file::pretty(&self.json);
        let files = [
            ("fit.csv", fit_csv(&self.estimates)),
            ("conditions.csv", conditions_csv(&self.conditions)),
            ("fit-independent.csv", fit_csv(&self.independent.0)),
            ("conditions-independent.csv", conditions_csv(&self.independent.1)),
            ("fit.json", json),
        ];
        write_files(disk, folder, &files.each_ref().map(|(name, text)| (*name, text.as_str())))
    }
}

/// Writes files, given as name and text, into `folder`; each file is replaced atomically.
///
/// # Errors
/// If a file cannot be written; the message names the path.
pub fn write_files(disk: &Disk, folder: &Folder, files: &[(&str, &str)]) -> Result<(), WriteError> {
    for (name, text) in files {
        disk.write(folder, name, text.as_bytes())
            .map_err(|source| WriteError { path: folder.path_of(name), source })?;
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
    text + ",trial,converged,optima"
}

/// Row of a trial under [`fit_header`].
pub fn fit_row(estimate: &TrialEstimate) -> String {
    let mut text = format!("{},{},{}", estimate.velocity_rad_s, estimate.torque_nm, estimate.repetition);
    for value in estimate.quantities().into_iter().chain(estimate.sem).chain(estimate.se) {
        text += ",";
        text += &cell(value);
    }
    text + &format!(",{},{},{}", estimate.trial, estimate.converged, 1 + estimate.other_optima.len())
}

/// Text of `fit.csv`.
fn fit_csv(estimates: &[TrialEstimate]) -> String {
    let labelled = estimates.iter().any(|estimate| estimate.condition.is_some());
    let mut text = fit_header() + if labelled { ",condition\n" } else { "\n" };
    for estimate in estimates {
        text += &fit_row(estimate);
        if labelled {
            text += &format!(",{}", csv_cell(estimate.condition.as_deref().unwrap_or("")));
        }
        text += "\n";
    }
    text
}

/// Text of `conditions.csv`.
fn conditions_csv(conditions: &[ConditionEstimate]) -> String {
    let mut text = "velocity_rad_s,torque_nm,repetitions".to_string();
    for name in QUANTITIES {
        text += &format!(",{name},sd_{name}");
    }
    for name in BASE_PARAMETERS {
        text += &format!(",se_{name}");
    }
    let labelled = conditions.iter().any(|condition| condition.condition.is_some());
    text += if labelled { ",condition\n" } else { "\n" };
    for condition in conditions {
        text += &format!("{},{},{}", condition.velocity_rad_s, condition.torque_nm, condition.repetitions);
        for (mean, sd) in condition.mean.iter().zip(condition.sd) {
            text += &format!(",{},{}", cell(*mean), cell(sd));
        }
        for se in condition.se {
            text += &format!(",{}", cell(se));
        }
        if labelled {
            text += &format!(",{}", csv_cell(condition.condition.as_deref().unwrap_or("")));
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
        entry.insert("se_of_rig_relative".into(), named(&estimate.se_of_rig, &BASE_PARAMETERS));
        entry.insert("other_optima".into(), other_optima_json(estimate));
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
            "se_relative": named(&condition.se, &BASE_PARAMETERS),
            "se_of_rig_relative": named(&condition.se_of_rig, &BASE_PARAMETERS),
        })
    };
    let samples = observations.window_noise_samples().count();
    let noise = |noise: &NoiseCovariance| {
        let noise = noise.of_first(samples);
        json!({
            "stretches": noise.stretches,
            "last_sample_sd_nm": noise.last_sample_sd_nm(),
            "effective_samples": noise.effective_samples(),
        })
    };
    let left_out = |left: &ExcludedTrial| json!({ "trial": left.trial, "reason": left.reason });
    let further = |(place, further): (usize, &ScaledChannel)| {
        let last = |noise: &NoiseCovariance| {
            let last = (2 + place) * samples - 1;
            libm::sqrt(noise.covariance[(last, last)]) / further.nm_per_unit
        };
        json!({
            "column": further.channel.column(),
            "nm_per_unit": further.nm_per_unit,
            "last_sample_sd": observations.noise_covariances.iter().map(last).collect::<Vec<_>>(),
            "encoder_step_rad": further.channel.is_angle().then_some(observations.further_step[place]),
        })
    };
    let mut contents = json!({
        "format": FIT_FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "subject": subject,
        "settings": {
            "window_s": settings.window_s,
            "filter": observations.filter,
            "weighting": weighting_used(weighting, fit),
            "lever": observations.lever,
            "rig_constants": observations.constants,
            "sample_rate_hz": 1.0 / observations.period_s,
            "stated_onsets_late_s": observations.stated_onsets_late_s(),
            "stated_onsets_early_s": observations.stated_onsets_early_s(),
        },
        "model": fit.model.json(),
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
    });
    if !observations.further.is_empty() {
        contents["further_channels"] = observations.further.iter().enumerate().map(further).collect();
    }
    contents
}

/// What is known of the rig's constants: the calibration, and what an error of the constants would do that nobody measured.
fn rig_json(observations: &Observations, fit: AskedFit, calibration: Option<&RigCalibration>) -> Value {
    let is_measured = |quantity: RigQuantity| calibration.is_some_and(|own| own.value(quantity).is_some());
    let of_lever = [RigQuantity::LeverInertia, RigQuantity::LeverDamping, RigQuantity::LeverStiffness];
    let lever = match (observations.lever, of_lever.iter().filter(|own| is_measured(**own)).count()) {
        (None, _) => "rigid",
        (Some(_), 0) => "assumed",
        (Some(_), measured) if measured < of_lever.len() => "measured in part",
        (Some(_), _) => "measured",
    };
    let quantity = |own: &crate::dataset::CalibratedQuantity| {
        json!({
            "name": own.name, "value": own.value, "se": own.se, "stated": own.stated, "reason": own.reason,
            "used": own.value.is_some() && RigConstants::applied().contains(&own.name),
        })
    };
    let calibrated = calibration.map(|own| {
        json!({
            "session": own.session,
            "made_utc": own.made_utc,
            "measured_utc": own.measured_utc,
            "program": own.program,
            "p_value_of_misfit": own.fit.p_value_of_misfit,
            "quantities": own.quantities.iter().map(quantity).collect::<Vec<_>>(),
        })
    });
    json!({
        "lever": lever,
        "calibration": calibrated,
        "assumed_error": ASSUMED_ERROR,
        "assumed": assumed_constants(observations, fit, is_measured),
    })
}

/// Adds to each trial how its parameters change by one standard error of each measured constant.
fn add_effects(json: &mut Value, effects: Option<&ConstantEffects>) {
    let Some(effects) = effects else { return };
    for (trial, entry) in json["trials"].as_array_mut().into_iter().flatten().enumerate() {
        let of = |(quantity, changes): (&RigQuantity, &Vec<[f64; 6]>)| {
            (quantity.name().to_owned(), named(&changes[trial].map(Some), &BASE_PARAMETERS))
        };
        let all: Map<_, _> = effects.quantities.iter().zip(&effects.per_se).map(of).collect();
        entry["change_by_se_of_constant"] = Value::Object(all);
    }
}

/// Values by name.
fn named(values: &[Option<f64>], names: &[&str]) -> Value {
    let own = names.iter().zip(values).map(|(name, value)| ((*name).to_string(), json!(value)));
    own.collect::<Map<_, _>>().into()
}

/// The fit of one trial on its own.
fn independent_json(estimate: &TrialEstimate) -> Value {
    json!({
        "values": named(&estimate.quantities(), &QUANTITIES),
        "sem_eq9_relative": named(&estimate.sem, &BASE_PARAMETERS),
        "se_relative": named(&estimate.se, &BASE_PARAMETERS),
        "se_of_rig_relative": named(&estimate.se_of_rig, &BASE_PARAMETERS),
        "other_optima": other_optima_json(estimate),
        "converged": estimate.converged,
        "remarks": estimate.remarks,
    })
}

/// Other optima of a trial within the noise, with their probability.
fn other_optima_json(estimate: &TrialEstimate) -> Value {
    let optimum = |own: &OtherOptimum| json!({ "values": named(&own.values.map(Some), &BASE_PARAMETERS), "probability": own.probability });
    estimate.other_optima.iter().map(optimum).collect()
}

/// The model of the session: spreads of the parameters about their regression, and exponents of velocity and torque; or why there is
/// none.
fn session_model_json(session: &Result<SessionFit, NoSessionModel>) -> Value {
    let session = match session {
        Ok(session) => session,
        Err(reason) => return json!({ "used": false, "reason": reason.to_string() }),
    };
    let hierarchy = &session.hierarchy;
    let count = session.parameters.len();
    let parameter = |(coordinate, parameter): (usize, &usize)| {
        let own = json!({
            "trial_sd": libm::sqrt(hierarchy.trial_variance[coordinate]),
            "condition_sd": libm::sqrt(hierarchy.condition_variance[coordinate]),
            "velocity_exponent": hierarchy.coefficients[count + coordinate],
            "torque_exponent": hierarchy.coefficients[2 * count + coordinate],
        });
        (BASE_PARAMETERS[*parameter].to_string(), own)
    };
    let parameters: Map<_, _> = session.parameters.iter().enumerate().map(parameter).collect();
    json!({ "used": true, "parameters": parameters })
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
