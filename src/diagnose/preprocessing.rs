//! Preprocessing for the diagnosis: a wide filter, input averaged over trials that move alike, mains hum removed.

use super::evidence::rig_knowledge::RigKnowledge;
use super::mains_hum::{DetectedHum, detect_hum, remove_hum};
use crate::dataset::Session;
use crate::fit::{Model, NoiseSource, Observations, PreprocessingError, PreprocessingSettings, RigConstants};
use crate::signal::FilterSpec;

/// A session preprocessed for the diagnosis.
#[derive(Debug, Clone)]
pub struct DiagnosisInput {
    /// The observations, without hum.
    pub observations: Observations,
    /// Hum that was found and is not in the model, and the observations that contain it.
    pub hum: Option<(DetectedHum, Box<Observations>)>,
    /// Number of usable_trials trials of the session; `observations` may hold only some of them.
    pub usable_trials: usize,
    /// What is known of the rig.
    pub rig: RigKnowledge,
}

/// Largest number of trials that are analysed. Every mechanism of the catalogue is fitted to them several times. Causes that this many
/// trials do not distinguish need another protocol rather than more of the same trials.
const MAX_DIAGNOSED_TRIALS: usize = 48;

/// Cut-off frequency of the diagnosis filter, Hz.
///
/// Through the paper's 50 Hz filter, joint damping or a stretch reflex changes the torque by less than one standard deviation of a
/// session's noise; through 300 Hz by eight or more. The noise above 50 Hz does no harm: residuals are weighted by the measured noise.
const DIAGNOSIS_CUTOFF_HZ: f64 = 300.0;
/// Largest cut-off frequency of the diagnosis filter, as a fraction of the sampling rate.
const MAX_CUTOFF_FRACTION: f64 = 0.16;

impl DiagnosisInput {
    /// Preprocesses `session` for a diagnosis under `model`.
    ///
    /// Where the holds are too short to measure the noise, it is estimated from the differences between repetitions.
    ///
    /// # Errors
    /// As [`Observations::new`].
    pub fn new(
        session: &Session,
        view: PreprocessingSettings,
        model: &Model,
    ) -> Result<Self, PreprocessingError> {
        Self::of_rig(session, view, model, RigKnowledge::stated(session.lever))
    }

    /// As [`DiagnosisInput::new`], with what is known of the rig.
    ///
    /// # Errors
    /// As [`Observations::of_rig`].
    pub fn of_rig(
        session: &Session,
        view: PreprocessingSettings,
        model: &Model,
        rig: RigKnowledge,
    ) -> Result<Self, PreprocessingError> {
        let constants = rig.constants;
        let prepare = |session: &Session| prepare(session, view, model, constants);
        if let Some(frequency_hz) = model.hum_hz() {
            let (observations, usable_trials) = prepare(&remove_hum(session, frequency_hz))?;
            return Ok(Self { observations, hum: None, usable_trials, rig });
        }
        let (as_it_is, usable_trials) = prepare(session)?;
        let Some(found) = detect_hum(session) else {
            return Ok(Self { observations: as_it_is, hum: None, usable_trials, rig });
        };
        let (observations, usable_trials) = prepare(&remove_hum(session, found.frequency_hz))?;
        Ok(Self { observations, hum: Some((found, Box::new(as_it_is))), usable_trials, rig })
    }
}

fn prepare(
    session: &Session,
    view: PreprocessingSettings,
    model: &Model,
    constants: RigConstants,
) -> Result<(Observations, usize), PreprocessingError> {
    let FilterSpec::Butterworth { order, cutoff_hz, zero_phase } = view.filter;
    let wide = DIAGNOSIS_CUTOFF_HZ.min(MAX_CUTOFF_FRACTION * session.sample_rate_hz).max(cutoff_hz);
    let filter = FilterSpec::Butterworth { order, cutoff_hz: wide, zero_phase };
    let mut observations =
        Observations::of_rig(session, PreprocessingSettings { filter, ..view }, constants)?;
    observations.average_motion();
    if observations.noise_source != Some(NoiseSource::Holds) {
        observations.estimate_noise_from_residuals(model);
    }
    let usable_trials = observations.trials.len();
    Ok((
        if usable_trials > MAX_DIAGNOSED_TRIALS {
            observations.subset(&some(&observations))
        } else {
            observations
        },
        usable_trials,
    ))
}

/// Indices of the trials that are analysed, spread evenly over the conditions and over the repetitions of each.
fn some(observations: &Observations) -> Vec<usize> {
    let count = observations.trials.len();
    // Trials are sorted by condition and repetition.
    (0..MAX_DIAGNOSED_TRIALS).map(|place| (2 * place + 1) * count / (2 * MAX_DIAGNOSED_TRIALS)).collect()
}
