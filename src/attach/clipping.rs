//! Whether EMG is clipped: an amplifier or a converter that is driven beyond its range gives the same extreme value for each peak beyond it.
//!
//! The values of EMG are distributed about their median with tails that fall. So a tail does not reach its last level more often than the
//! levels before it, on average, however coarse the levels are; a continuous signal reaches its extreme once. Where it is clipped, all peaks
//! beyond the range end at the last level. A stay at a level counts once, since neighbouring samples are not independent.

use serde::{Deserialize, Serialize};

/// Probability with which a sound tail is called clipped.
const FALSE_CLIPPING: f64 = 1e-6;

/// Most levels before the last with which it is compared: few enough that a tail does not fall much over them.
const MOST_LEVELS: f64 = 100.0;

/// A column of EMG that reaches the end of its range: an amplifier or a converter was driven beyond it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ClippedEmg {
    /// The column.
    pub column: String,
    /// The extreme value, in the unit of the column.
    pub value: f64,
    /// Samples of the trials that have it.
    pub samples: usize,
    /// The trials that have such samples.
    pub trials: Vec<u32>,
}

/// The ends of its range at which a column of EMG is clipped, over the values of all trials.
pub fn clipped(column: &str, trials: &[(u32, &[f64])]) -> Vec<ClippedEmg> {
    let has_both_signs = trials.iter().any(|(_, values)| values.iter().any(|value| *value < 0.0));
    // Rectified EMG is 0 as often as it likes.
    let signs: &[f64] = if has_both_signs { &[1.0, -1.0] } else { &[1.0] };
    let of_end = |sign: &f64| {
        let level = sign * clipped_level(trials, *sign)?;
        let at_level = |values: &[f64]| values.iter().filter(|value| **value == level).count();
        let counts = trials.iter().map(|(number, values)| (*number, at_level(values)));
        let there: Vec<(u32, usize)> = counts.filter(|(_, samples)| *samples > 0).collect();
        Some(ClippedEmg {
            column: column.to_owned(),
            value: level,
            samples: there.iter().map(|own| own.1).sum(),
            trials: there.iter().map(|own| own.0).collect(),
        })
    };
    signs.iter().filter_map(of_end).collect()
}

/// The highest of the values times `sign`, if they are clipped there.
fn clipped_level(trials: &[(u32, &[f64])], sign: f64) -> Option<f64> {
    // A stay at a level is one value.
    let mut stays: Vec<f64> = Vec::new();
    for (_, values) in trials {
        let begins = |at: &usize| *at == 0 || values[*at] != values[at - 1];
        stays.extend((0..values.len()).filter(begins).map(|at| sign * values[at]));
    }
    stays.sort_by(f64::total_cmp);
    let (median, last) = (*stays.get(stays.len() / 2)?, *stays.last()?);
    let step = usual_step(&stays)?;
    let levels = ((last - median) / step).min(MOST_LEVELS);
    if levels < 1.0 {
        return None;
    }
    let from = |value: f64| stays.len() - stays.partition_point(|own| *own < value);
    let at_last = from(last) as f64;
    let all = from(last - (levels + 0.5) * step) as f64;
    (all * divergence(at_last / all, 1.0 / (1.0 + levels)) > -libm::log(FALSE_CLIPPING)).then_some(last)
}

/// The median step between neighbouring levels of sorted values: that of the converter, where most of its levels are there.
fn usual_step(sorted: &[f64]) -> Option<f64> {
    let mut steps: Vec<f64> =
        sorted.windows(2).map(|pair| pair[1] - pair[0]).filter(|step| *step > 0.0).collect();
    let middle = steps.len() / 2;
    (!steps.is_empty()).then(|| *steps.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// Divergence of a share from a larger probability `chance`: `n` times it is the least that minus the logarithm of the binomial tail can be
/// (Chernoff); 0 for a share that is not above `chance`.
fn divergence(share: f64, chance: f64) -> f64 {
    if share <= chance {
        return 0.0;
    }
    let rest = if share < 1.0 { (1.0 - share) * libm::log((1.0 - share) / (1.0 - chance)) } else { 0.0 };
    share * libm::log(share / chance) + rest
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Trials of 2 s of EMG whose size changes slowly, with a standard deviation of some `steps` steps of the converter.
    fn emg(seed: u64, steps: f64) -> Vec<Vec<f64>> {
        let mut stream = Stream::new(seed, "emg");
        let trial = |number: usize| {
            let mut smooth = 0.0;
            let mut sample = |at: usize| {
                smooth += 0.5 * (stream.normal() - smooth);
                let size = 1.0 + libm::sin(at as f64 / 300.0 + number as f64);
                libm::round(steps * size * smooth)
            };
            (0..4000).map(&mut sample).collect()
        };
        (0..20).map(trial).collect()
    }

    fn found(trials: &[Vec<f64>]) -> Vec<ClippedEmg> {
        let numbered: Vec<(u32, &[f64])> = (1..).zip(trials).map(|(at, own)| (at, own.as_slice())).collect();
        clipped("FCR", &numbered)
    }

    #[test]
    fn sound_emg_of_any_resolution_is_not_clipped() {
        for steps in [0.2, 0.5, 1.0, 3.0, 30.0, 1000.0, 1e7] {
            for seed in 0..5 {
                let raw = emg(seed, steps);
                assert_eq!(found(&raw), [], "{steps} steps, seed {seed}");
                let rectified: Vec<Vec<f64>> =
                    raw.iter().map(|own| own.iter().map(|value| value.abs()).collect()).collect();
                assert_eq!(found(&rectified), [], "{steps} steps, rectified, seed {seed}");
            }
        }
    }

    #[test]
    fn emg_beyond_the_range_of_its_converter_is_told_at_each_end_with_value_and_samples() {
        let mut trials = emg(1, 10_000.0);
        trials.iter_mut().flatten().for_each(|value| *value = value.clamp(-25_000.0, 20_000.0));
        let ends = found(&trials);
        assert_eq!(ends.iter().map(|end| end.value).collect::<Vec<_>>(), [20_000.0, -25_000.0]);
        let samples = trials.iter().flatten().filter(|value| **value == 20_000.0).count();
        assert_eq!(ends[0].samples, samples);
    }

    #[test]
    fn a_coarse_converter_that_clips_most_of_the_signal_is_found() {
        let mut trials = emg(1, 300.0);
        trials.iter_mut().flatten().for_each(|value| *value = value.clamp(-100.0, 100.0));
        assert_eq!(found(&trials).len(), 2);
    }
}
