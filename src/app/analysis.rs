//! Preprocessing, fit and diagnosis of a session.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::consistency::SignalCheck;
use crate::dataset::{self, PROGRAM, Status};
use crate::diagnose::{Diagnosis, DiagnosisInput, diagnose, remove_hum};
use crate::fit::{
    Fit, Model, NoSessionModel, Observations, PreprocessingSettings, Results, SessionFit, Weighting,
};

use super::calibration::UsedCalibration;
use super::checked_session::{CheckedSession, load_checked};
use super::console::Console;
use super::failure::Failure;

/// Which data an analysis is asked to use, and how.
#[derive(Debug, Clone, Default)]
pub struct AnalysisRequest {
    /// The analysed time after the onset, s; without it the session's protocol decides, and without a protocol it is the 0.040 s
    /// of the paper.
    pub window_s: Option<f64>,
    /// The file of the rig's constants; without it that in the session's folder, if there is one.
    pub calibration: Option<PathBuf>,
    /// Contradictions between the signals and the table that are known and meant.
    pub accept: Vec<SignalCheck>,
}

/// A session that is analysed, with all that its analysis rests on except the model.
pub struct AnalysedSession {
    /// The session, and what it contradicts.
    pub checked: CheckedSession,
    /// Its name in messages.
    pub name: String,
    /// Window and filter.
    pub settings: PreprocessingSettings,
    /// The calibration of the rig; without one the constants are those that the session states.
    pub calibration: Option<UsedCalibration>,
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

/// A diagnosed session.
pub struct DiagnosedSession {
    /// What was diagnosed.
    pub input: DiagnosisInput,
    /// The diagnosis.
    pub diagnosis: Diagnosis,
    /// The contents of diagnosis.json.
    pub json: Value,
}

impl AnalysedSession {
    /// Reads the session in `folder`, and says which calibration is used.
    ///
    /// # Errors
    /// If session or calibration cannot be read, or the session contradicts its table.
    pub fn read(folder: &Path, asked: &AnalysisRequest, console: &Console) -> Result<Self, Failure> {
        let checked = load_checked(folder, &asked.accept)?;
        let protocol = dataset::protocol_of_session(folder, &checked.session)?;
        let settings = protocol.as_deref().map(PreprocessingSettings::of).unwrap_or_default();
        let settings = with_window(settings, asked.window_s)?;
        let calibration = UsedCalibration::of_session(asked.calibration.as_deref(), folder)?;
        if let Some(used) = &calibration {
            used.announce(console);
            checked.check_calibrated(folder, used, &asked.accept)?;
        }
        Ok(Self { checked, name: folder.display().to_string(), settings, calibration })
    }

    /// Fits `model`, each trial on its own and, unless `independent_only`, with the model of the session.
    ///
    /// # Errors
    /// If the session cannot be prepared, or the calibration cannot be used for it.
    pub fn fit(
        &self,
        model: &Model,
        weighting: Weighting,
        independent_only: bool,
    ) -> Result<FittedSession, Failure> {
        let CheckedSession { session, accepted } = &self.checked;
        let digest = session.digest();
        let without_hum = model.hum_hz().map(|frequency_hz| remove_hum(session, frequency_hz));
        let session = without_hum.as_ref().unwrap_or(session);
        let used = self.calibration_at_its_torques();
        let used = used.as_ref();
        let constants = UsedCalibration::constants(used, session.lever)?;
        let observations = Observations::of_rig(session, self.settings, constants)
            .map_err(|source| Failure::Prepare { session: self.name.clone(), source })?;
        let independent = Fit::new(&observations, model, weighting);
        let together = if independent_only {
            Err(NoSessionModel::NotAsked)
        } else {
            SessionFit::new(&observations, &independent)
        };
        let calibration = used.map(|used| &used.calibration);
        let fits = (&independent, &together);
        let mut results =
            Results::new(&session.subject.id, &observations, fits, self.settings, weighting, calibration);
        let sha256 = used.map(|used| used.sha256.as_str());
        results.add_input(&digest, independent_only, accepted, sha256);
        Ok(FittedSession { observations, results, independent, together })
    }

    /// Preprocesses the session for a diagnosis from `model`.
    ///
    /// # Errors
    /// If the session cannot be prepared, or the calibration cannot be used for it.
    pub fn prepare_diagnosis(&self, model: &Model) -> Result<DiagnosisInput, Failure> {
        let session = &self.checked.session;
        let rig = UsedCalibration::knowledge(self.calibration_at_its_torques().as_ref(), session.lever)?;
        DiagnosisInput::of_rig(session, self.settings, model, rig)
            .map_err(|source| Failure::Prepare { session: self.name.clone(), source })
    }

    /// The calibration as far as it holds at the largest torque of the session.
    fn calibration_at_its_torques(&self) -> Option<UsedCalibration> {
        let usable = self.checked.session.trials.iter().filter(|trial| trial.status == Status::Ok);
        let torques = usable.flat_map(|trial| &trial.record.torque_l_nm);
        let largest_nm = torques.fold(0.0, |largest: f64, torque| largest.max(torque.abs()));
        self.calibration.clone().map(|used| used.at_torques_up_to(largest_nm))
    }

    /// Diagnoses the session from `input`, which [`Self::prepare_diagnosis`] made of it with the same model.
    ///
    /// `seed` is that of the null distributions. `stage` is called with what is done next.
    pub fn diagnose(
        &self,
        input: DiagnosisInput,
        model: &Model,
        seed: u64,
        stage: &dyn Fn(&'static str),
    ) -> DiagnosedSession {
        let diagnosis = diagnose(&input, model, seed, &|name| stage(name));
        let mut json = diagnosis.to_json(&input.observations);
        json["accepted"] = json!(self.checked.accepted);
        json["settings"] = json!({
            "window_s": self.settings.window_s,
            "seed": seed,
            "calibration_sha256": self.calibration.as_ref().map(|used| &used.sha256),
        });
        json["model"] = model.json();
        json["made_from"] = json!({ "session_sha256": self.checked.session.digest(), "program": PROGRAM });
        DiagnosedSession { input, diagnosis, json }
    }
}

/// Checks that all trials of the session in the folder `session` are in `observations`.
///
/// # Errors
/// If there are others.
pub fn check_none_left_out(session: &Path, observations: &Observations) -> Result<(), Failure> {
    let left_out = observations.excluded_trials.clone();
    if left_out.is_empty() {
        return Ok(());
    }
    let analysed = observations.trials.len();
    Err(Failure::TrialsLeftOut { session: session.display().to_string(), analysed, left_out })
}

/// `settings` with the analysed time `window_s` after the onset, s, where it is given.
///
/// # Errors
/// If it is no time that can be analysed.
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
