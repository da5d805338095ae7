//! Preprocessing, fit and diagnosis of a session.

use std::path::Path;

use serde_json::{Value, json};

use crate::consistency::SignalCheck;
use crate::dataset::{self, PROGRAM, Session};
use crate::diagnose::{Diagnosis, DiagnosisInput, diagnose, remove_hum};
use crate::fit::{
    Fit, Model, NoSessionModel, Observations, PreprocessingSettings, Results, SessionFit, Weighting,
};

use super::checked_session::{CheckedSession, load_checked};
use super::failure::Failure;

/// What a fit is asked for.
#[derive(Debug, Clone, Default)]
pub struct FitRequest {
    /// The model.
    pub model: Model,
    /// The analysed time after the onset, s; without it the session's protocol decides, and without a protocol it is the 0.040 s
    /// of the paper.
    pub window_s: Option<f64>,
    /// The weighting of the residuals.
    pub weighting: Weighting,
    /// Each trial on its own, as in the paper.
    pub independent: bool,
    /// Contradictions between the signals and the table that are known and meant.
    pub accept: Vec<SignalCheck>,
}

/// Reads, preprocesses and fits a session: the observations, the results as they are written, and the fit of each trial on its own.
pub fn preprocess_and_fit(
    folder: &Path,
    asked: &FitRequest,
) -> Result<(Observations, Results, Fit), Failure> {
    let checked = load_checked(folder, &asked.accept)?;
    let settings = preprocessing_settings(folder, asked.window_s)?;
    let fitted = fit_session(checked, &folder.display().to_string(), settings, asked)?;
    Ok((fitted.observations, fitted.results, fitted.independent))
}

/// A fitted session.
pub struct FittedSession {
    /// What was fitted.
    pub observations: Observations,
    /// The results as they are written.
    pub results: Results,
    /// The fit of each trial on its own.
    pub independent: Fit,
    /// The fit with the model of the session, or why there is none.
    pub together: Result<SessionFit, NoSessionModel>,
}

/// Preprocesses and fits a session that was read, or given by a program; `name` is its name in messages.
///
/// `settings` decides about window and filter; the fields `window_s` and `accept` of `asked` are not read.
pub fn fit_session(
    checked: CheckedSession,
    name: &str,
    settings: PreprocessingSettings,
    asked: &FitRequest,
) -> Result<FittedSession, Failure> {
    let FitRequest { model, weighting, independent: is_independent, .. } = asked;
    let CheckedSession { mut session, accepted } = checked;
    let digest = session.digest();
    if let Some(frequency_hz) = model.hum_hz() {
        session = remove_hum(&session, frequency_hz);
    }
    let observations = Observations::new(&session, settings)
        .map_err(|source| Failure::Prepare { session: name.to_owned(), source })?;
    let independent = Fit::new(&observations, model, *weighting);
    let together = if *is_independent {
        Err(NoSessionModel::NotAsked)
    } else {
        SessionFit::new(&observations, &independent)
    };
    let mut results =
        Results::new(&session.subject.id, &observations, (&independent, &together), settings, *weighting);
    results.add_input(&digest, *is_independent, &accepted);
    Ok(FittedSession { observations, results, independent, together })
}

/// A diagnosed session.
pub struct DiagnosedSession {
    /// What was diagnosed.
    pub input: DiagnosisInput,
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The contents of diagnosis.json.
    pub json: Value,
}

/// Preprocesses a session for a diagnosis from `model`; `name` is its name in messages.
pub fn prepare_diagnosis(
    session: &Session,
    name: &str,
    settings: PreprocessingSettings,
    model: &Model,
) -> Result<DiagnosisInput, Failure> {
    DiagnosisInput::new(session, settings, model)
        .map_err(|source| Failure::Prepare { session: name.to_owned(), source })
}

/// Diagnoses a session that was read, or given by a program, from `input`, which [`prepare_diagnosis`] made of it.
///
/// `seed` is that of the null distributions. `stage` is called with what is done next.
pub fn diagnose_session(
    checked: &CheckedSession,
    input: DiagnosisInput,
    settings: PreprocessingSettings,
    model: &Model,
    seed: u64,
    stage: &dyn Fn(&'static str),
) -> DiagnosedSession {
    let diagnosis = diagnose(&input, model, seed, &|name| stage(name));
    let mut json = diagnosis.to_json(&input.observations);
    json["accepted"] = json!(checked.accepted);
    json["settings"] = json!({ "window_s": settings.window_s, "seed": seed });
    json["model"] = model.json();
    json["made_from"] = json!({ "session_sha256": checked.session.digest(), "program": PROGRAM });
    DiagnosedSession { input, diagnosis, json }
}

/// The filter and the analysed window of a session: those of its protocol, or of the paper where it has none.
///
/// `window_s` replaces the window.
pub fn preprocessing_settings(
    folder: &Path,
    window_s: Option<f64>,
) -> Result<PreprocessingSettings, Failure> {
    let mut settings = PreprocessingSettings::default();
    if let Some(protocol) = dataset::stored_protocol(folder)? {
        settings = PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter };
    }
    with_window(settings, window_s)
}

/// `settings` with the analysed time `window_s` after the onset, s, where it is given.
pub fn with_window(
    mut settings: PreprocessingSettings,
    window_s: Option<f64>,
) -> Result<PreprocessingSettings, Failure> {
    if let Some(window_s) = window_s {
        if !(window_s > 0.0 && window_s <= 10.0) {
            return Err(Failure::Usage(format!(
                "--window {window_s}: expected seconds, more than 0 and at most 10"
            )));
        }
        settings.window_s = window_s;
    }
    Ok(settings)
}
