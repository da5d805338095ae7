//! Channels that were at the end of what they can show: by the range that the session declares, and a torque by its shape.
//!
//! A converter that is saturated gives one value again and again, the highest or lowest of the record, and comes to it with a slope that
//! ends at once. A signal that turns round by itself is equal for some samples too where its resolution is coarse, but comes there slowly.

use std::collections::BTreeMap;
use std::ops::Range;

use super::contradiction::Contradiction;
use super::frozen_emg::longest_run_by_chance;
use super::ramp::rounded;
use super::repeated_record::has_noise;
use super::samples_of_ramp::{RampChannel, resolution, samples_of_ramp};
use super::signal_check::SignalCheck;
use crate::dataset::Trial;

/// The fewest equal samples that count: of two, a third of the noise's own pairs consists in coarse channels.
const FEWEST_SAMPLES: usize = 3;

/// A signal that turns round within a step of its resolution in L samples came there by 4/L steps in the sample before (a parabola). Four
/// times as much is an end of the slope.
const TURNING_STEPS: f64 = 16.0;

/// What to do with trials whose channel was clipped.
const CLIPPED_REMEDY: &str = "Set these trials to rejected with ramphold trials --reject, and give the channel a wider range for the next session.";

/// Samples of a record that are equal.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Plateau {
    value: f64,
    samples: usize,
}

/// Channels of `trials` that reach the end of their range in `ranges`, by the names of their columns; and torques that look clipped.
pub fn check_clipped(
    trials: &[&Trial],
    ranges: &BTreeMap<String, [f64; 2]>,
    sample_rate_hz: f64,
) -> Vec<Contradiction> {
    let declared: Vec<Contradiction> = ranges
        .iter()
        .filter_map(|(column, range)| beyond_range(column, *range, trials, sample_rate_hz))
        .collect();
    let is_told = declared.iter().any(|one| one.place.contains(RampChannel::Torque.column()));
    let by_shape = if is_told { None } else { plateaus(trials, sample_rate_hz) };
    declared.into_iter().chain(by_shape).collect()
}

fn beyond_range(
    column: &str,
    [low, high]: [f64; 2],
    trials: &[&Trial],
    sample_rate_hz: f64,
) -> Option<Contradiction> {
    let of_trial = |trial: &&Trial| -> Option<(u32, usize, f64)> {
        let (_, values) = trial.record.channels().find(|(name, _)| *name == column)?;
        let ramp = samples_of_ramp(trial, sample_rate_hz)?;
        let at_end = values.get(ramp)?.iter().filter(|value| **value <= low || **value >= high);
        let samples = at_end.clone().count();
        Some((trial.number, samples, *at_end.clone().next()?))
    };
    let found: Vec<(u32, usize, f64)> = trials.iter().filter_map(of_trial).collect();
    let (number, samples, value) = *found.iter().max_by_key(|own| own.1)?;
    Some(Contradiction {
        check: SignalCheck::Clipped,
        place: format!("column {column} of the records"),
        trials: found.iter().map(|own| own.0).collect(),
        measured: format!(
            "in trial {number}, {samples} samples about the ramp are at the end of the channel's range or beyond it, such as {}",
            rounded(value)
        ),
        stated: format!(
            "values between {} and {}, as session.json gives the range in field channels.{column}.range",
            rounded(low),
            rounded(high)
        ),
        likely_mistake: Some("Was the amplifier saturated, or is the range another one?".into()),
        remedy: CLIPPED_REMEDY.into(),
    })
}

fn plateaus(trials: &[&Trial], sample_rate_hz: f64) -> Option<Contradiction> {
    let channel = RampChannel::Torque;
    let all: usize = trials.iter().map(|trial| channel.of(trial).len()).sum();
    let found: Vec<(&Trial, Plateau)> = trials
        .iter()
        .filter_map(|trial| {
            let ramp = samples_of_ramp(trial, sample_rate_hz)?;
            Some((*trial, clipped(channel.of(trial), ramp, all)?))
        })
        .collect();
    let (trial, Plateau { value, samples }) = found.iter().max_by_key(|own| own.1.samples)?;
    let unit = channel.unit();
    Some(Contradiction {
        check: SignalCheck::Clipped,
        place: format!("column {} of the records", channel.column()),
        trials: found.iter().map(|own| own.0.number).collect(),
        measured: format!(
            "in the ramp of trial {} ({}) {samples} samples in a row are {} {unit} to the last digit, the farthest of the record",
            trial.number,
            trial.file,
            rounded(*value)
        ),
        stated: "a torque that changes as long as the ramp goes on".into(),
        likely_mistake: Some("Was the amplifier or the converter saturated?".into()),
        remedy: CLIPPED_REMEDY.into(),
    })
}

/// The longest run of samples at the highest or lowest value of a record of a session with `all` samples that begins in the ramp, and that
/// neither its noise nor its resolution explains.
fn clipped(values: &[f64], ramp: Range<usize>, all: usize) -> Option<Plateau> {
    // A computed torque without noise stands still wherever the motor does.
    if !has_noise(values) {
        return None;
    }
    let ends = values
        .iter()
        .fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value| [low.min(*value), high.max(*value)]);
    ends.into_iter().filter_map(|end| at_end(values, ramp.clone(), end, all)).max_by_key(|own| own.samples)
}

fn at_end(values: &[f64], ramp: Range<usize>, end: f64, all: usize) -> Option<Plateau> {
    let mut longest: Option<(usize, usize)> = None;
    let mut at = ramp.start.max(2);
    while at < ramp.end.min(values.len()) {
        let samples = values[at..].iter().take_while(|value| **value == end).count();
        if values[at - 1] != end && longest.is_none_or(|(_, before)| samples > before) {
            longest = Some((at, samples));
        }
        at += samples.max(1);
    }
    let (begin, samples) = longest.filter(|(_, samples)| *samples >= FEWEST_SAMPLES)?;
    let slope = (values[begin - 1] - values[begin - 2]).abs();
    if slope * samples as f64 <= TURNING_STEPS * resolution(values) {
        return None;
    }
    // The probability of two equal neighbours is that of the rest of the record, with one pair of either kind added.
    let equal = values.windows(2).filter(|pair| pair[0] == pair[1]).count();
    let pairs = values.len() - samples;
    let chance = (equal.saturating_sub(samples - 1) + 1) as f64 / (pairs + 2) as f64;
    ((samples - 1) as f64 > longest_run_by_chance(chance, all)).then_some(Plateau { value: end, samples })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// A torque that rises from a hold to `high`, and is cut off at `end`; noise of `noise` steps of `step`.
    fn torque(high: f64, end: f64, noise: f64, step: f64) -> Vec<f64> {
        let mut stream = Stream::new(5, "clipped");
        let shape = |at: usize| match at {
            ..1000 => 1.0,
            1000..1200 => 1.0 + (high - 1.0) * libm::sin((at - 1000) as f64 / 200.0 * std::f64::consts::PI),
            _ => 1.0,
        };
        let converted = |value: f64| step * libm::round(value / step);
        (0..1500).map(|at| converted((shape(at) + noise * step * stream.normal()).min(end))).collect()
    }

    fn found(values: &[f64]) -> Option<Plateau> {
        clipped(values, 900..1250, 60 * values.len())
    }

    #[test]
    fn a_torque_at_the_end_of_its_converter_is_found_whatever_its_noise() {
        for noise in [0.4, 1.0, 4.0] {
            let Plateau { value, samples } = found(&torque(9.0, 8.0, noise, 0.005)).unwrap();
            assert!(value == 8.0 && samples > 30, "{noise}: {samples} at {value}");
        }
    }

    #[test]
    fn a_torque_that_turns_round_by_itself_is_not_clipped_however_coarse_its_resolution() {
        for step in [1e-5, 1e-3, 0.02, 0.1, 0.5] {
            for noise in [0.0, 0.3, 0.4, 1.0, 2.0] {
                assert_eq!(found(&torque(9.0, f64::INFINITY, noise, step)), None, "{step} {noise}");
            }
        }
    }
}
