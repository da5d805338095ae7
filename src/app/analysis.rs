//! Preprocessing and fit of a session in its folder.

use std::path::{Path, PathBuf};

use crate::consistency::SignalCheck;
use crate::dataset;
use crate::diagnose::remove_hum;
use crate::fit::{
    Fit, Model, NoSessionModel, Observations, PreprocessingSettings, Results, SessionFit, Weighting,
};

use super::calibration::UsedCalibration;
use super::checked_session::{CheckedSession, load_checked};
use super::console::Console;
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
    /// The file of the rig's constants; without it that in the session's folder, if there is one.
    pub calibration: Option<PathBuf>,
    /// Contradictions between the signals and the table that are known and meant.
    pub accept: Vec<SignalCheck>,
}

/// Reads, preprocesses and fits a session: the observations, the results as they are written, and the fit of each trial on its own. Says
/// which calibration was used.
pub fn preprocess_and_fit(
    folder: &Path,
    asked: &FitRequest,
    console: &Console,
) -> Result<(Observations, Results, Fit), Failure> {
    let FitRequest { model, window_s, weighting, independent, accept, calibration } = asked;
    let CheckedSession { mut session, accepted } = load_checked(folder, accept)?;
    let digest = session.digest();
    if let Some(frequency_hz) = model.hum_hz() {
        session = remove_hum(&session, frequency_hz);
    }
    let settings = preprocessing_settings(folder, *window_s)?;
    let used = UsedCalibration::of_session(calibration.as_deref(), folder)?;
    let constants = UsedCalibration::constants(used.as_ref(), session.lever)?;
    used.iter().for_each(|used| used.announce(console));
    let observations = Observations::of_rig(&session, settings, constants)
        .map_err(|source| Failure::Prepare { session: folder.display().to_string(), source })?;
    let fit = Fit::new(&observations, model, *weighting);
    let of_session =
        if *independent { Err(NoSessionModel::NotAsked) } else { SessionFit::new(&observations, &fit) };
    let calibration = used.as_ref().map(|used| &used.calibration);
    let fits = (&fit, &of_session);
    let mut results =
        Results::new(&session.subject.id, &observations, fits, settings, *weighting, calibration);
    results.add_input(&digest, *independent, &accepted, used.as_ref().map(|used| used.sha256.as_str()));
    Ok((observations, results, fit))
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
