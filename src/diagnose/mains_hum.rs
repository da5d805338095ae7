//! Mains hum. It is present in the hold as in the ramp: it is detected in the holds and subtracted from the whole record.

use super::interval::Interval;
use crate::dataset::{Session, Status, Trial};
use crate::fit::onset_sample;
use crate::signal::Sinusoid;
use crate::statistics::{f_tail, largest_posterior};

/// Mains hum found in the holds.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct DetectedHum {
    /// Frequency, 50 or 60 Hz.
    pub frequency_hz: f64,
    /// Root mean square of the amplitude over the trials, with the ends of its 95 % interval, N m.
    pub amplitude_nm: [f64; 3],
    /// Probability of hum at least as strong in noise alone, corrected for both frequencies.
    pub p_value: f64,
}

/// Mains frequencies, Hz.
const MAINS_HZ: [f64; 2] = [50.0, 60.0];

/// Longest part of the hold before the onset that is analysed, s.
const MAX_HOLD_S: f64 = 0.5;

/// Distances from the mains frequency of the spectral lines that give the noise level there, in line widths.
const NEIGHBOUR_LINES: [f64; 4] = [-5.0, -3.0, 3.0, 5.0];

/// Significance level of the test for mains hum. Strict, since every session is tested and few have hum.
const HUM_LEVEL: f64 = 1e-3;

/// Prior probability of hum that matters: one session in ten. Assumed.
const PRIOR_PROBABILITY: f64 = 0.1;

/// Posterior probability of `hum`, from the largest Bayes factor that its p-value allows.
pub fn hum_probability(hum: &DetectedHum) -> f64 {
    largest_posterior(PRIOR_PROBABILITY, hum.p_value)
}

impl DetectedHum {
    /// Amplitude and frequency with their 95 % intervals.
    pub fn intervals(&self) -> Vec<Interval> {
        let [value, low, high] = self.amplitude_nm;
        let frequency = Some(self.frequency_hz);
        vec![
            Interval { value, low: Some(low), high: Some(high) },
            Interval { value: self.frequency_hz, low: frequency, high: frequency },
        ]
    }
}

/// Detects hum in the holds of `session`, the stronger of the two frequencies; `None` if it is not significant.
///
/// In noise alone the ratio of the power at a frequency to that at the neighbouring lines is F distributed, with two degrees of freedom
/// for each trial and independent line.
pub fn detect_hum(session: &Session) -> Option<DetectedHum> {
    MAINS_HZ
        .into_iter()
        .filter_map(|hz| at(session, hz))
        .filter(|found| found.p_value < HUM_LEVEL)
        .max_by(|a, b| a.amplitude_nm[0].total_cmp(&b.amplitude_nm[0]))
}

fn at(session: &Session, hz: f64) -> Option<DetectedHum> {
    let period_s = 1.0 / session.sample_rate_hz;
    let (mut powers, mut beside) = (Vec::new(), Vec::new());
    for trial in session.trials.iter().filter(|trial| trial.status == Status::Ok) {
        let Some(hold) = hold(trial, period_s) else { continue };
        let width_hz = 1.0 / (hold.len() as f64 * period_s);
        let power = |hz: f64| Sinusoid::fitted(hold, period_s, hz).map(|own| own.power());
        let around: Option<Vec<f64>> =
            NEIGHBOUR_LINES.iter().map(|lines| power(hz + lines * width_hz)).collect();
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
    let tail = f_tail(ratio, [freedom, freedom * NEIGHBOUR_LINES.len() as f64 / 2.0]);
    let excess: Vec<f64> = powers.iter().zip(&beside).map(|(own, beside)| own - beside).collect();
    let spread = excess.iter().map(|own| (own - mean(&excess)) * (own - mean(&excess))).sum::<f64>();
    let margin = 1.96 * libm::sqrt(spread / (count - 1.0) / count);
    let amplitude = |square: f64| libm::sqrt(square.max(0.0));
    Some(DetectedHum {
        frequency_hz: hz,
        amplitude_nm: [0.0, -margin, margin].map(|by| amplitude(mean(&excess) + by)),
        p_value: (MAINS_HZ.len() as f64 * tail).min(1.0),
    })
}

/// Subtracts hum at `frequency_hz` from every trial of `session`, with the amplitude and phase of the trial's hold.
pub fn remove_hum(session: &Session, frequency_hz: f64) -> Session {
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

/// The torque of the hold before the onset, N m.
fn hold(trial: &Trial, period_s: f64) -> Option<&[f64]> {
    let end = onset_sample(trial, period_s)?;
    let longest = libm::round(MAX_HOLD_S / period_s) as usize;
    trial.record.torque_l_nm.get(end.saturating_sub(longest)..end)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Record, Subject};
    use crate::random::Stream;

    /// Two trials with noise of 0.01 N m and hum of 0.05 N m at 50 Hz in their holds, all `times` as large.
    fn humming(times: f64) -> Session {
        let mut noise = Stream::new(4, "hum");
        let trial = |number: u32| {
            let hum = |time_s: f64| 0.05 * libm::sin(2.0 * std::f64::consts::PI * 50.0 * time_s);
            let torque = |sample: u32| times * (hum(f64::from(sample) / 1000.0) + 0.01 * noise.normal());
            let torque_l_nm: Vec<f64> = (0..1200).map(torque).collect();
            let theta_m_rad = vec![0.0; torque_l_nm.len()];
            Trial {
                number,
                file: String::new(),
                velocity_rad_s: 1.0,
                torque_nm: 1.0,
                repetition: 1,
                condition: None,
                onset_s: Some(1.0),
                status: Status::Ok,
                extra: Default::default(),
                record: Record { theta_m_rad, torque_l_nm, ..Record::default() },
            }
        };
        Session {
            subject: Subject { id: "P1".into() },
            sample_rate_hz: 1000.0,
            lever: None,
            recorded_filter: None,
            channel_ranges: Default::default(),
            trials: [1, 2].map(trial).into(),
        }
    }

    #[test]
    fn hum_in_the_holds_is_found_with_its_amplitude() {
        let found = detect_hum(&humming(1.0)).unwrap();
        assert_eq!(found.frequency_hz, 50.0);
        assert!((found.amplitude_nm[0] - 0.05).abs() < 0.005, "{found:?}");
    }

    #[test]
    fn a_torque_whose_square_is_beyond_all_numbers_has_no_hum() {
        assert!(detect_hum(&humming(1e200)).is_none());
    }
}
