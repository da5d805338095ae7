//! A session as a diagnosis looks at it: through a wide filter, with one motion for trials that move alike, without hum.

use super::mains_hum::{Hum, hum, without};
use crate::dataset::Session;
use crate::fit::{Model, NoiseSource, Observations, PreprocessingError, PreprocessingSettings};
use crate::signal::FilterSpec;

/// What is diagnosed.
#[derive(Debug, Clone)]
pub struct Look {
    /// The session prepared.
    pub prepared: Observations,
    /// Hum that was found and that the model does not have, and the session with it.
    pub hum: Option<(Hum, Box<Observations>)>,
    /// How many trials the session has that can be used; of many, some are looked at.
    pub usable: usize,
}

/// Most trials that are looked at. Every mechanism of the catalogue is fitted to them several times, and causes that this many
/// do not tell apart are told apart by another protocol rather than by more of the same.
const MOST_TRIALS: usize = 48;

/// Cut-off of the filter that a diagnosis looks through, Hz, and the part of the sampling rate that it stays below.
///
/// Behind the paper's 50 Hz a joint damping or a stretch reflex leaves less than one standard deviation of a session's noise;
/// up to 300 Hz it leaves eight or more. Residuals are weighed by the measured noise, so its share beyond 50 Hz does no harm.
const CUTOFF_HZ: f64 = 300.0;
const PART_OF_RATE: f64 = 0.16;

impl Look {
    /// Looks at `session` in the light of `model`.
    ///
    /// Where the holds are too short to tell the noise, it is taken from how the repetitions differ.
    ///
    /// # Errors
    /// As [`Observations::new`].
    pub fn new(
        session: &Session,
        view: PreprocessingSettings,
        model: &Model,
    ) -> Result<Self, PreprocessingError> {
        if let Some(frequency_hz) = model.hum_hz() {
            let (prepared, usable) = prepare(&without(session, frequency_hz), view, model)?;
            return Ok(Self { prepared, hum: None, usable });
        }
        let (as_it_is, usable) = prepare(session, view, model)?;
        let Some(found) = hum(session) else { return Ok(Self { prepared: as_it_is, hum: None, usable }) };
        let (prepared, usable) = prepare(&without(session, found.frequency_hz), view, model)?;
        Ok(Self { prepared, hum: Some((found, Box::new(as_it_is))), usable })
    }
}

fn prepare(
    session: &Session,
    view: PreprocessingSettings,
    model: &Model,
) -> Result<(Observations, usize), PreprocessingError> {
    let FilterSpec::Butterworth { order, cutoff_hz, zero_phase } = view.filter;
    let wide = CUTOFF_HZ.min(PART_OF_RATE * session.sample_rate_hz).max(cutoff_hz);
    let filter = FilterSpec::Butterworth { order, cutoff_hz: wide, zero_phase };
    let mut prepared = Observations::new(session, PreprocessingSettings { filter, ..view })?;
    prepared.average_motion();
    if prepared.noise_source != Some(NoiseSource::Holds) {
        prepared.take_noise_from_repetitions(model);
    }
    let usable = prepared.trials.len();
    Ok((if usable > MOST_TRIALS { prepared.subset(&some(&prepared)) } else { prepared }, usable))
}

/// As many trials as are looked at, spread evenly over the conditions and within each over its repetitions.
fn some(prepared: &Observations) -> Vec<usize> {
    let count = prepared.trials.len();
    // Trials come by condition and repetition.
    (0..MOST_TRIALS).map(|place| (2 * place + 1) * count / (2 * MOST_TRIALS)).collect()
}
