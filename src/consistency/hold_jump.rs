//! Wrong samples of the torque before a ramp: one, or a stretch of some milliseconds, that jumps away from what surrounds it and back.
//!
//! The noise that weighs every trial is measured there, so one lost byte weakens the whole session. Muscle and tremor are slower than the
//! jump: they take tens of samples to half of their height.

use std::ops::Range;

use super::contradiction::Contradiction;
use super::ramp::rounded;
use super::samples_of_ramp::{RampChannel, resolution, samples_of_ramp};
use super::spike::{LARGEST_BY_NOISE, LEAST_PART, RESOLUTION_STEPS, wrong_samples};
use crate::dataset::Trial;
use crate::statistics::{SD_BY_MEDIAN, upper_median};

/// Time before the ramp that is looked at, s: the half second of which the noise is taken, and in which the filter's answer to what is before it
/// dies away.
const LOOKED_AT_S: f64 = 0.6;

/// Length of the blocks whose medians say where the torque is, s: one period of a mains hum. A wrong stretch that is shorter moves the median
/// of one block at most, and none of three.
const BLOCK_S: f64 = 0.02;

/// Samples within which a wrong stretch begins and ends: it jumps at one, and a converter's own filter spreads that over another.
const EDGE_SAMPLES: usize = 2;

/// A stretch of samples far from those around it.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Jump {
    /// The farthest sample, in the record.
    sample: usize,
    /// How far it is from the torque around it, N m.
    height_nm: f64,
    /// How far noise, resolution and a fiftieth of the torque let it be, N m.
    by_chance_nm: f64,
}

/// Torques before the ramps that those around them contradict.
pub fn check_jumps(trials: &[&Trial], sample_rate_hz: f64) -> Option<Contradiction> {
    let found: Vec<(&Trial, Jump)> =
        trials.iter().filter_map(|trial| Some((*trial, jump_of(trial, sample_rate_hz)?))).collect();
    let (trial, jump) = found.iter().max_by(|a, b| a.1.height_nm.total_cmp(&b.1.height_nm))?;
    let channel = RampChannel::Torque;
    Some(wrong_samples(
        channel,
        found.iter().map(|(trial, _)| trial.number).collect(),
        format!(
            "before the ramp, the sample at {} s of trial {} ({}, line {}) is {} N m, and {} N m from the torque around it",
            rounded(trial.record.start_s + jump.sample as f64 / sample_rate_hz),
            trial.number,
            trial.file,
            jump.sample + 2,
            rounded(channel.of(trial)[jump.sample]),
            rounded(jump.height_nm)
        ),
        jump.by_chance_nm,
        "the noise of all trials is measured before the ramps",
    ))
}

fn jump_of(trial: &Trial, sample_rate_hz: f64) -> Option<Jump> {
    let ramp = samples_of_ramp(trial, sample_rate_hz)?;
    let samples = |time_s: f64| libm::round(time_s * sample_rate_hz) as usize;
    let values = &RampChannel::Torque.of(trial)[..ramp.start];
    let first = values.len().saturating_sub(samples(LOOKED_AT_S));
    let hold = &values[first..];
    let off = off_blocks(hold, samples(BLOCK_S))?;
    let farthest = (0..off.len()).filter(|place| off[*place].is_finite());
    let sample = farthest.max_by(|a, b| off[*a].abs().total_cmp(&off[*b].abs()))?;
    let height_nm = off[sample].abs();
    let held_nm = upper_median(hold.iter().map(|value| value.abs()))?;
    let noise = SD_BY_MEDIAN * upper_median(off.iter().map(|own| own.abs()))?;
    let by_chance_nm =
        (LARGEST_BY_NOISE * noise).max(RESOLUTION_STEPS * resolution(hold)).max(LEAST_PART * held_nm);
    let jumps = height_nm > by_chance_nm && has_edges(&off, sample);
    jumps.then_some(Jump { sample: first + sample, height_nm, by_chance_nm })
}

/// How far each value is from the median of its block, that before it and that after it, whichever is between the others; `None` for less than three
/// blocks.
fn off_blocks(values: &[f64], block: usize) -> Option<Vec<f64>> {
    let blocks = values.len().checked_div(block)?;
    if blocks < 3 {
        return None;
    }
    let samples = |number: usize| -> Range<usize> {
        let end = if number + 1 == blocks { values.len() } else { (number + 1) * block };
        number * block..end
    };
    let medians: Option<Vec<f64>> =
        (0..blocks).map(|number| upper_median(values[samples(number)].iter().copied())).collect();
    let medians = medians?;
    let mut off = Vec::with_capacity(values.len());
    for number in 0..blocks {
        let first = number.saturating_sub(1).min(blocks - 3);
        let middle = upper_median(medians[first..first + 3].iter().copied())?;
        off.extend(values[samples(number)].iter().map(|value| value - middle));
    }
    Some(off)
}

/// Whether the stretch about `sample` that is more than half as far off begins and ends within [`EDGE_SAMPLES`]: from a quarter to a half. The ends
/// of what is looked at are edges as well.
fn has_edges(off: &[f64], sample: usize) -> bool {
    let part = |place: usize| off[place] / off[sample];
    let first = (0..sample).rev().find(|place| part(*place) < 0.5);
    let last = (sample..off.len()).find(|place| part(*place) < 0.5);
    let before = first.is_none_or(|place| part(place.saturating_sub(EDGE_SAMPLES - 1)) < 0.25);
    let after = last.is_none_or(|place| part((place + EDGE_SAMPLES - 1).min(off.len() - 1)) < 0.25);
    before && after
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Noise of 10 mN m on a tremor of 30 mN m at 9 Hz and a torque that drifts, at 2.5 kHz, with `add` N m.
    fn hold(add: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut stream = Stream::new(11, "hold");
        let tremor = |at: usize| 0.03 * libm::sin(std::f64::consts::TAU * 9.0 * at as f64 / 2500.0);
        (0..1500).map(|at| 2.0 - 1e-4 * at as f64 + tremor(at) + 0.01 * stream.normal() + add(at)).collect()
    }

    /// Whether a sample of `values` jumps beyond its noise.
    fn jumps(values: &[f64]) -> bool {
        let off = off_blocks(values, 50).unwrap();
        let noise = SD_BY_MEDIAN * upper_median(off.iter().map(|own| own.abs())).unwrap();
        let sample = (0..off.len()).max_by(|a, b| off[*a].abs().total_cmp(&off[*b].abs())).unwrap();
        off[sample].abs() > LARGEST_BY_NOISE * noise && has_edges(&off, sample)
    }

    #[test]
    fn a_lost_sample_and_a_dropout_jump_and_a_twitch_and_a_relaxing_muscle_do_not() {
        for width in [1, 2, 20] {
            assert!(jumps(&hold(|at| if (700..700 + width).contains(&at) { -1.9 } else { 0.0 })), "{width}");
        }
        let twitch = hold(|at| 1.5 * libm::exp(-((at as f64 - 700.0) / 60.0).powi(2)));
        let rising = hold(|at| -2.0 * libm::exp(-(at as f64) / 100.0));
        for slow in [hold(|_| 0.0), twitch, rising] {
            assert!(!jumps(&slow));
        }
    }
}
