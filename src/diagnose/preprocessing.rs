//! Preprocessing for the diagnosis: a wide filter, input averaged over trials that move alike or, behind a coarse encoder, what its steps say
//! of it, mains hum removed.

use super::evidence::rig_knowledge::RigKnowledge;
use super::mains_hum::{DetectedHum, detect_hum, remove_hum};
use crate::dataset::Session;
use crate::fit::{
    Fit, Model, NoSessionModel, NoiseSource, Observations, PreprocessingError, PreprocessingSettings,
    RigConstants, Weighting, coarse_angle,
};
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
    /// That the steps of the encoder are coarse, and the motions are those between them; `None`, too, where these cannot be computed.
    pub coarse_encoder: Option<CoarseEncoder>,
}

/// An encoder whose steps are coarse.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CoarseEncoder {
    /// Variance of the torque error from averaged angles, by that of the torque's own noise.
    pub ratio: f64,
    /// Step of the encoder, rad.
    pub step_rad: f64,
}

/// A session of which the observations are made.
struct Prepared {
    observations: Observations,
    usable_trials: usize,
    coarse_encoder: Option<CoarseEncoder>,
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
            return Ok(prepare(&remove_hum(session, frequency_hz))?.of_rig(rig, None));
        }
        let as_it_is = prepare(session)?;
        let Some(found) = detect_hum(session) else { return Ok(as_it_is.of_rig(rig, None)) };
        let without_hum = prepare(&remove_hum(session, found.frequency_hz))?;
        Ok(without_hum.of_rig(rig, Some((found, Box::new(as_it_is.observations)))))
    }
}

impl Prepared {
    fn of_rig(self, rig: RigKnowledge, hum: Option<(DetectedHum, Box<Observations>)>) -> DiagnosisInput {
        let Self { observations, usable_trials, coarse_encoder } = self;
        DiagnosisInput { observations, hum, usable_trials, rig, coarse_encoder }
    }
}

fn prepare(
    session: &Session,
    view: PreprocessingSettings,
    model: &Model,
    constants: RigConstants,
) -> Result<Prepared, PreprocessingError> {
    let FilterSpec::Butterworth { order, cutoff_hz, zero_phase } = view.filter;
    let wide = DIAGNOSIS_CUTOFF_HZ.min(MAX_CUTOFF_FRACTION * session.sample_rate_hz).max(cutoff_hz);
    let filter = FilterSpec::Butterworth { order, cutoff_hz: wide, zero_phase };
    let mut observations =
        Observations::of_rig(session, PreprocessingSettings { filter, ..view }, constants)?;
    let as_recorded = observations.clone();
    observations.average_motion();
    let usable_trials = observations.trials.len();
    let analysed = |observations: &Observations| match usable_trials > MAX_DIAGNOSED_TRIALS {
        true => observations.subset(&some(observations)),
        false => observations.clone(),
    };
    if let Some(ratio) = coarse_ratio(&observations, model) {
        let mut in_steps = analysed(&as_recorded);
        if in_steps.take_motions_in_steps() {
            let coarse_encoder = Some(CoarseEncoder { ratio, step_rad: in_steps.angle_step_rad });
            return Ok(Prepared { observations: in_steps, usable_trials, coarse_encoder });
        }
    }
    if observations.noise_source != Some(NoiseSource::Holds) {
        observations.estimate_noise_from_residuals(model);
    }
    Ok(Prepared { observations: analysed(&observations), usable_trials, coarse_encoder: None })
}

/// Variance of the torque error from averaged angles, by that of the torque's own noise, where the first is most of the error and comes from
/// the steps of an encoder.
fn coarse_ratio(observations: &Observations, model: &Model) -> Option<f64> {
    if observations.angle_step_rad == 0.0 || observations.noise_source != Some(NoiseSource::Holds) {
        return None;
    }
    match coarse_angle(observations, &Fit::new(observations, model, Weighting::MeasuredNoise)) {
        Some(NoSessionModel::CoarseAngle { ratio, .. }) => Some(ratio),
        _ => None,
    }
}

/// Indices of the trials that are analysed, spread evenly over the conditions and over the repetitions of each.
fn some(observations: &Observations) -> Vec<usize> {
    let count = observations.trials.len();
    // Trials are sorted by condition and repetition.
    (0..MAX_DIAGNOSED_TRIALS).map(|place| (2 * place + 1) * count / (2 * MAX_DIAGNOSED_TRIALS)).collect()
}
