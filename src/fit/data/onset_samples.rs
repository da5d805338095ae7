//! The samples at which the ramps of a session begin.
//!
//! An onset that is found in one record is late by a sample or two, and not equally late in all. The trials of one velocity move alike, so
//! that their records together say how late. Behind a coarse encoder a ramp that is one sample late differs from the others by tens of steps,
//! more than any servo gives way to its load; and all that moved before the onset would be counted as rest.

use super::observations::{mean, mean_signal};
use crate::dataset::Trial;
use crate::signal::{farthest, onset, smallest_step};
use crate::statistics::{group_indices, upper_median};

/// Time before an onset over which the rest is averaged, s.
const REST_BEFORE_S: f64 = 0.010;

/// Part of the way up to which motions are compared: beyond, the load may turn the motors differently.
const COMPARED_PART: f64 = 0.25;

/// A motion stands out of the rest by this many steps of its encoder, or this many times the way that it goes while the rest is averaged, or
/// this part of its whole way. A hold may drift: from the middle of that time to the onset it goes two and a half times as far, twice that is
/// no drift.
const STANDS_OUT: (f64, f64, f64) = (1.25, 5.0, 3e-4);

/// A stated onset is late where the motors turn at this part of their largest speed already: a joint that gives way in the hold turns its motor
/// at less than a hundredth.
const TURNING: f64 = 0.05;

/// Longest time by which an onset is late, s: of a speed that rises over 30 ms, the check of the input refuses what is later.
const LATEST_ONSET_S: f64 = 0.020;

/// A stated onset is early where the motors begin to turn this long after it, s: a servo follows its command sooner, and what is stated is no
/// onset of a ramp.
const EARLY_S: f64 = 0.005;

/// Most rounds of comparing the motions with their mean and moving the onsets; two are usual.
const ALIGNMENT_ROUNDS: usize = 5;

/// Sample at which the ramp of a trial begins: the onset that the session gives, otherwise the onset detected in the motor
/// angle; `None` if no movement is detected.
pub fn onset_sample(trial: &Trial, period_s: f64) -> Option<usize> {
    match trial.onset_s {
        Some(onset_s) => Some(libm::round((onset_s - trial.record.start_s) / period_s) as usize),
        None => onset(&trial.record.theta_m_rad),
    }
}

/// Where the ramp of a trial begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct RampBegin {
    /// The last sample before the motor moves.
    pub sample: usize,
    /// By how many samples the onset that the session states is after it, or before it if negative; 0 if none is stated.
    pub stated_late: isize,
}

/// Where the ramp of each trial begins, by all trials of its velocity together; `None` where no movement is detected. Stated onsets are taken
/// as they are, unless the motors have visibly moved by then, or begin to move much later and the records have a `window` of samples from there.
pub fn ramp_begins(trials: &[&Trial], period_s: f64, window: usize) -> Vec<Option<RampBegin>> {
    let samples = |time_s: f64| (libm::round(time_s / period_s) as usize).max(2);
    let single: Vec<Option<usize>> = trials.iter().map(|trial| onset_sample(trial, period_s)).collect();
    let known: Vec<usize> = (0..trials.len()).filter(|place| single[*place].is_some()).collect();
    let key = |which: usize| {
        let trial = trials[known[which]];
        (trial.velocity_rad_s.to_bits(), trial.condition.clone(), trial.onset_s.is_some())
    };
    let mut begins = vec![None; trials.len()];
    for ((_, _, is_stated), group) in group_indices(known.len(), key) {
        let places: Vec<usize> = group.into_iter().map(|which| known[which]).collect();
        let angles: Vec<&[f64]> =
            places.iter().map(|place| trials[*place].record.theta_m_rad.as_slice()).collect();
        let onsets: Vec<usize> = places.iter().filter_map(|place| single[*place]).collect();
        let begin = if is_stated {
            begins_of_stated(&angles, &onsets, &samples, window)
        } else {
            begins_of_found(&angles, &onsets, &samples)
        };
        for ((place, onset), sample) in places.into_iter().zip(onsets).zip(begin) {
            let stated_late = if is_stated { onset as isize - sample as isize } else { 0 };
            begins[place] = Some(RampBegin { sample, stated_late });
        }
    }
    begins
}

/// Where motions that are alike begin, of which each is seen to move at one of the `onsets`.
fn begins_of_found(angles: &[&[f64]], onsets: &[usize], samples: &impl Fn(f64) -> usize) -> Vec<usize> {
    let (rest, latest) = (samples(REST_BEFORE_S), samples(LATEST_ONSET_S));
    let common = common_onsets(angles, onsets, rest);
    let late = late_by(angles, &common, rest, latest).map_or(0, |late| late.samples.max(0));
    common.iter().map(|onset| onset.saturating_add_signed(-late)).collect()
}

/// Where motions that are alike begin, of which each is stated to begin at one of the `onsets`: there, unless that is visibly late or early.
fn begins_of_stated(
    angles: &[&[f64]],
    onsets: &[usize],
    samples: &impl Fn(f64) -> usize,
    window: usize,
) -> Vec<usize> {
    let (rest, latest) = (samples(REST_BEFORE_S), samples(LATEST_ONSET_S));
    let is_off = |late: Lateness| late.is_visible || -late.samples > samples(EARLY_S) as isize;
    if !late_by(angles, onsets, rest, latest).is_some_and(is_off) {
        return onsets.to_vec();
    }
    let common = common_onsets(angles, onsets, rest);
    let late = late_by(angles, &common, rest, latest).map_or(0, |late| late.samples);
    let begins: Vec<usize> = common.iter().map(|onset| onset.saturating_add_signed(-late)).collect();
    let fits = |((begin, onset), angle): ((&usize, &usize), &&[f64])| {
        begin <= onset || begin + window <= angle.len()
    };
    if begins.iter().zip(onsets).zip(angles).all(fits) { begins } else { onsets.to_vec() }
}

/// The `onsets` of motions that are alike, moved so that all are at the same place of the motion, and by as little as possible. `rest` is the
/// number of samples over which the rest is averaged.
fn common_onsets(angles: &[&[f64]], onsets: &[usize], rest: usize) -> Vec<usize> {
    let mut common = onsets.to_vec();
    for _ in 0..ALIGNMENT_ROUNDS {
        let Some(lead) = leads(angles, &common, rest) else { return onsets.to_vec() };
        let begins: Vec<f64> = common.iter().zip(lead).map(|(onset, lead)| *onset as f64 - lead).collect();
        let moved = on_samples(&begins, onsets);
        if moved == common {
            break;
        }
        common = moved;
    }
    common
}

/// How many samples each motion is ahead of the mean of all, if they are as alike as the first part of a ramp is; `None` if the records are
/// too short to say.
fn leads(angles: &[&[f64]], onsets: &[usize], rest: usize) -> Option<Vec<f64>> {
    let moved = about(angles, onsets, rest)?;
    let together = mean_signal(&moved);
    let way = farthest(together.iter().copied());
    let compared = (rest..together.len()).find(|sample| together[*sample] / way > COMPARED_PART)?;
    let places = rest..compared.min(together.len().checked_sub(2)?);
    let speed: Vec<f64> =
        places.clone().map(|sample| 0.5 * (together[sample + 1] - together[sample - 1])).collect();
    let square = speed.iter().map(|own| own * own).sum::<f64>();
    let lead = |own: &Vec<f64>| {
        let along = |(sample, speed): (usize, &f64)| speed * (own[sample] - together[sample]);
        places.clone().zip(&speed).map(along).sum::<f64>() / square
    };
    (square > 0.0).then(|| moved.iter().map(lead).collect())
}

/// How late onsets are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Lateness {
    /// Number of samples; negative if the motion begins later.
    samples: isize,
    /// The motion stands out of the rest at the onset already, and is no drift.
    is_visible: bool,
}

/// How late the `onsets` of motions that are alike are, at most `latest`, or how early if that is negative; `None` if the records are too short to say. `rest` is the number of
/// samples over which the rest is averaged.
///
/// A speed that rises smoothly grows at first with the square of time or faster, and the way with its third power: it takes as long from where
/// the way stands out of the rest to eight times as far as it took up to there.
fn late_by(angles: &[&[f64]], onsets: &[usize], rest: usize, latest: usize) -> Option<Lateness> {
    let moved = about(angles, onsets, latest + rest)?;
    let together = mean_signal(&moved);
    let way = farthest(together.iter().copied());
    let level = mean(&together[..rest]);
    let (low, high) =
        together[..rest].iter().fold((f64::MAX, f64::MIN), |(low, high), own| (own.min(low), own.max(high)));
    let step = smallest_step(angles.iter().copied());
    let (steps, drifts, part) = STANDS_OUT;
    let far = (steps * step).max(drifts * (high - low)).max(part * way.abs());
    let passes = |far: f64| -> Option<f64> {
        let gone = |sample: usize| (together[sample] - level) * way.signum();
        let after = (rest..together.len()).find(|sample| gone(*sample) > far)?;
        Some(after as f64 - (gone(after) - far) / (gone(after) - gone(after - 1)))
    };
    let (first, second) = (passes(far)?, passes(8.0 * far)?);
    let onset = (latest + rest) as f64;
    let samples = (onset - libm::floor(2.0 * first - second)) as isize;
    // Over a fourth of the rest, so that the steps of an encoder weigh little.
    let turned = |sample: usize| (together[sample] - together[sample - rest / 4 - 1]) * way.signum();
    let fastest = (rest..together.len()).map(turned).fold(0.0, f64::max);
    let is_visible = first < onset && turned(latest + rest) > TURNING * fastest;
    Some(Lateness { samples: samples.min(latest as isize), is_visible })
}

/// The motions from `before` samples before their onsets on, less the rest there; `None` if a record does not begin early enough.
fn about(angles: &[&[f64]], onsets: &[usize], before: usize) -> Option<Vec<Vec<f64>>> {
    let after = angles.iter().zip(onsets).map(|(angle, onset)| angle.len().saturating_sub(*onset)).min()?;
    let moved = |(angle, onset): (&&[f64], &usize)| -> Option<Vec<f64>> {
        let first = onset.checked_sub(before)?;
        let level = mean(angle.get(first..*onset)?);
        Some(angle[first..*onset + after].iter().map(|own| own - level).collect())
    };
    angles.iter().zip(onsets).map(moved).collect()
}

/// The samples nearest to `begins`, all at the same place of the motion if the samples are, and as near to `onsets` as that allows.
fn on_samples(begins: &[f64], onsets: &[usize]) -> Vec<usize> {
    // Begins at the same place between two samples must not be rounded apart: the mean of the places on the circle is taken off first.
    let angle = |begin: &f64| std::f64::consts::TAU * begin;
    let sine: f64 = begins.iter().map(|begin| libm::sin(angle(begin))).sum();
    let cosine: f64 = begins.iter().map(|begin| libm::cos(angle(begin))).sum();
    let between = libm::atan2(sine, cosine) / std::f64::consts::TAU;
    let rounded: Vec<f64> = begins.iter().map(|begin| libm::round(begin - between)).collect();
    let apart: Vec<f64> = onsets.iter().zip(&rounded).map(|(onset, own)| *onset as f64 - own).collect();
    let moved = upper_median(apart).unwrap_or(0.0);
    rounded.iter().map(|own| (own + moved).max(0.0) as usize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ramp of constant speed behind a rise, on samples of 1 ms, in steps of 14 bits.
    fn stepped(begin: f64, speed_rad_s: f64) -> Vec<f64> {
        let step = std::f64::consts::TAU / 16384.0;
        let angle = |sample: usize| {
            let later = (sample as f64 - begin).max(0.0);
            let rise = 12.0;
            let way = if later < rise { later * later / (2.0 * rise) } else { later - 0.5 * rise };
            libm::round(way * 1e-3 * speed_rad_s / step) * step
        };
        (0..300).map(angle).collect()
    }

    #[test]
    fn onsets_of_motions_that_are_alike_are_at_the_same_place_of_the_motion() {
        let begins = [150.3, 171.3, 160.3, 144.3, 181.3];
        let angles: Vec<Vec<f64>> = begins.iter().map(|begin| stepped(*begin, 1.5)).collect();
        let angles: Vec<&[f64]> = angles.iter().map(Vec::as_slice).collect();
        let found = [152, 172, 163, 147, 183];
        let common = common_onsets(&angles, &found, 10);
        let apart: Vec<f64> = common.iter().zip(begins).map(|(onset, begin)| *onset as f64 - begin).collect();
        assert!(apart.iter().all(|own| (own - apart[0]).abs() < 1e-9), "{apart:?}");
        assert!((apart[0] - 1.7).abs() < 1.1, "{apart:?}");
    }

    #[test]
    fn motions_begin_before_they_stand_out_of_the_rest() {
        // A speed that rises with the square of time, and an encoder that shows the first step after 6 samples.
        let step = 1e-4;
        let angle = |sample: usize, rest: f64| {
            let later = (sample as f64 - 150.0).max(0.0);
            libm::round((later * later * later * 4e-7 + rest * step) / step) * step
        };
        let motions: Vec<Vec<f64>> = (0..8)
            .map(|trial| (0..200).map(|sample| angle(sample, f64::from(trial) / 8.0)).collect())
            .collect();
        let angles: Vec<&[f64]> = motions.iter().map(Vec::as_slice).collect();
        let late = late_by(&angles, &[156; 8], 10, 20).unwrap();
        assert!((5..=7).contains(&late.samples) && !late.is_visible, "{late:?}");
        assert!(late_by(&angles, &[165; 8], 10, 20).unwrap().is_visible);
    }

    #[test]
    fn a_motor_that_drifts_before_the_ramp_has_not_begun_it() {
        // As a measured ankle that gives way before it is turned: 0.2 mrad in 30 ms, slower and slower.
        let angle = |sample: usize| {
            let before = (150.0 - sample as f64).max(0.0);
            2e-4 * libm::exp(-before / 15.0) + (sample as f64 - 150.0).max(0.0) * 1.5e-3
        };
        let motion: Vec<f64> = (0..300).map(angle).collect();
        let late = late_by(&[&motion, &motion], &[150, 150], 10, 20).unwrap();
        assert!(!late.is_visible, "{late:?}");
    }

    #[test]
    fn begins_half_way_between_two_samples_are_not_rounded_apart() {
        assert_eq!(on_samples(&[10.49, 20.51, 30.5], &[11, 21, 31]), [11, 21, 31]);
        assert_eq!(on_samples(&[10.49, 20.51, 30.5], &[11, 20, 31]), [11, 21, 31]);
    }

    #[test]
    fn onsets_of_records_that_end_at_once_stay() {
        let angle = stepped(150.0, 1.5);
        assert_eq!(common_onsets(&[&angle, &angle[..151]], &[150, 150], 10), [150, 150]);
    }
}
