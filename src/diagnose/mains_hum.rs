//! Hum of the mains: it is in the hold as well as in the ramp, so it is found there and taken out of the whole record.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::dataset::{Session, Status, Trial};
use crate::fit::onset_sample;
use crate::signal::Sinusoid;

/// Hum found in the holds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Hum {
    /// 50 or 60 Hz.
    pub frequency_hz: f64,
    /// Root mean square over the trials of its amplitude, N m, and its 95 % interval.
    pub amplitude_nm: [f64; 3],
    /// Probability of as much where there is none.
    pub p_value: f64,
}

/// The mains of the world, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Longest stretch before the onset that is looked at, s.
const LONGEST_S: f64 = 0.5;

/// The neighbours that tell what is there without hum lie this many widths of the spectrum's lines away.
const NEIGHBOURS: [f64; 4] = [-5.0, -3.0, 3.0, 5.0];

/// Hum is looked for at two frequencies in every session, and few have any.
const SIGNIFICANT: f64 = 1e-3;

/// Looks for hum in the holds of `session`; the stronger of the two frequencies.
///
/// In noise alone the power at a frequency over that beside it is F distributed, two degrees of freedom for each trial and
/// frequency (those beside share some).
pub fn hum(session: &Session) -> Option<Hum> {
    MAINS_HZ
        .into_iter()
        .filter_map(|hz| at(session, hz))
        .filter(|found| found.p_value < SIGNIFICANT)
        .max_by(|a, b| a.amplitude_nm[0].total_cmp(&b.amplitude_nm[0]))
}

fn at(session: &Session, hz: f64) -> Option<Hum> {
    let period_s = 1.0 / session.sample_rate_hz;
    let (mut powers, mut beside) = (Vec::new(), Vec::new());
    for trial in session.trials.iter().filter(|trial| trial.status == Status::Ok) {
        let Some(hold) = hold(trial, period_s) else { continue };
        let width_hz = 1.0 / (hold.len() as f64 * period_s);
        let power = |hz: f64| Sinusoid::fitted(hold, period_s, hz).map(|own| own.power());
        let around: Option<Vec<f64>> = NEIGHBOURS.iter().map(|lines| power(hz + lines * width_hz)).collect();
        if let (Some(own), Some(around)) = (power(hz), around) {
            powers.push(own);
            beside.push(around.iter().sum::<f64>() / around.len() as f64);
        }
    }
    let count = powers.len() as f64;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / count;
    if powers.len() < 2 || mean(&beside) <= 0.0 {
        return None;
    }
    let freedom = 2.0 * count;
    let ratio = mean(&powers) / mean(&beside);
    let tail = FisherSnedecor::new(freedom, freedom * NEIGHBOURS.len() as f64 / 2.0).ok()?.sf(ratio);
    let excess: Vec<f64> = powers.iter().zip(&beside).map(|(own, beside)| own - beside).collect();
    let spread = excess.iter().map(|own| (own - mean(&excess)) * (own - mean(&excess))).sum::<f64>();
    let margin = 1.96 * libm::sqrt(spread / (count - 1.0) / count);
    let amplitude = |square: f64| libm::sqrt(square.max(0.0));
    Some(Hum {
        frequency_hz: hz,
        amplitude_nm: [0.0, -margin, margin].map(|by| amplitude(mean(&excess) + by)),
        p_value: (MAINS_HZ.len() as f64 * tail).min(1.0),
    })
}

/// `session` without the hum of each trial's own amplitude and phase.
pub fn without(session: &Session, frequency_hz: f64) -> Session {
    let period_s = 1.0 / session.sample_rate_hz;
    let mut clean = session.clone();
    for trial in &mut clean.trials {
        let Some(hold) = hold(trial, period_s) else { continue };
        let Some(hum) = Sinusoid::fitted(hold, period_s, frequency_hz) else { continue };
        let end = onset_sample(trial, period_s).unwrap_or(0) as f64 - 1.0;
        for (sample, torque) in trial.record.torque_l_nm.iter_mut().enumerate() {
            *torque -= hum.at((sample as f64 - end) * period_s);
        }
    }
    clean
}

/// The torque before the onset.
fn hold(trial: &Trial, period_s: f64) -> Option<&[f64]> {
    let end = onset_sample(trial, period_s)?;
    let longest = libm::round(LONGEST_S / period_s) as usize;
    trial.record.torque_l_nm.get(end.saturating_sub(longest)..end)
}
