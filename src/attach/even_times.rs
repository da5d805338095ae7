//! Times of the samples of a steady device from stamps that are late: by the programs and the network on their way, never early.

use std::collections::VecDeque;

use crate::statistics::upper_median;

/// Time over which the least late sample is looked for, on either side, s.
const WINDOW_S: f64 = 1.0;

/// Seconds over which the period of the samples is measured, at most: samples that are lost are in few of such stretches.
const APART_SECONDS: usize = 10;

/// They are at most this part of the recording, so that most are without a loss.
const APART_PARTS: usize = 5;

/// Samples were lost where the axis steps by more than this many periods, and by more than this many times the usual lateness.
const LOSS_STEPS: f64 = 1.5;
const LOSS_LATENESS: f64 = 3.0;

/// Shortest step between samples, of the usual one: where the stamps become less late, times still go on.
const SHORTEST_STEP: f64 = 0.5;

/// Times on an even axis.
#[derive(Debug, Clone, PartialEq)]
pub struct EvenTimes {
    /// Times of the samples, s.
    pub times_s: Vec<f64>,
    /// Root mean square of what the stamps are later than that, s.
    pub late_rms_s: f64,
}

/// Puts stamps of a device of some `nominal_hz` samples a second on an even axis, each of the `parts` by itself.
pub fn even_times<'a>(parts: impl Iterator<Item = &'a [f64]>, nominal_hz: f64) -> EvenTimes {
    let (mut times_s, mut squares): (Vec<f64>, f64) = (Vec::new(), 0.0);
    for stamps_s in parts {
        let own = even_part(stamps_s, nominal_hz, times_s.last().copied());
        squares += stamps_s.iter().zip(&own).map(|(stamp, time)| (stamp - time).powi(2)).sum::<f64>();
        times_s.extend(own);
    }
    EvenTimes { late_rms_s: (squares / times_s.len().max(1) as f64).sqrt(), times_s }
}

/// Puts stamps on an even axis, behind the time of the sample before them.
///
/// A sample is where the least late sample of the second before and after it has the axis. Where those after it are all later, by more than
/// stamps are late, samples were lost: from there on the axis is where they have it, and times step at once by as much as was lost.
fn even_part(stamps_s: &[f64], nominal_hz: f64, before_s: Option<f64>) -> Vec<f64> {
    let period_s = period_s(stamps_s, nominal_hz);
    let late: Vec<f64> =
        stamps_s.iter().enumerate().map(|(at, stamp_s)| stamp_s - at as f64 * period_s).collect();
    let window = (WINDOW_S / period_s).max(1.0) as usize;
    let before = least_before(late.iter().copied(), window);
    let mut after = least_before(late.iter().rev().copied(), window);
    after.reverse();
    let least = |at: usize| f64::min(before[at], after[at]);
    let usual_s = upper_median((0..late.len()).map(|at| late[at] - least(at))).unwrap_or(0.0);
    let step_s = (LOSS_STEPS * period_s).max(LOSS_LATENESS * usual_s);
    let mut times_s: Vec<f64> = Vec::with_capacity(late.len());
    for at in 0..late.len() {
        let axis_s = if after[at] - before[at] > step_s { after[at] } else { least(at) };
        let earliest_s = times_s
            .last()
            .or(before_s.as_ref())
            .map_or(f64::NEG_INFINITY, |last| last + SHORTEST_STEP * period_s);
        times_s.push((at as f64 * period_s + axis_s).max(earliest_s));
    }
    times_s
}

/// The usual time between two samples: from the least late sample of each second to that of some seconds later, the median of all.
fn period_s(stamps_s: &[f64], nominal_hz: f64) -> f64 {
    let late = |at: usize| stamps_s[at] - at as f64 / nominal_hz;
    let second = (nominal_hz as usize).max(1);
    // An incomplete second may not have a sample that is little late.
    let seconds = (0..stamps_s.len() / second)
        .filter_map(|own| (own * second..(own + 1) * second).min_by(|a, b| late(*a).total_cmp(&late(*b))));
    let least_late: Vec<usize> = seconds.collect();
    let apart = (least_late.len() / APART_PARTS).clamp(1, APART_SECONDS);
    let pairs = least_late.iter().zip(least_late.iter().skip(apart));
    let periods = pairs.map(|(from, to)| (stamps_s[*to] - stamps_s[*from]) / (to - from) as f64);
    let usable = periods.filter(|period_s| *period_s > 0.0 && period_s.is_finite());
    upper_median(usable).unwrap_or(1.0 / nominal_hz)
}

/// The least of each value and the `window` values before it.
fn least_before(values: impl Iterator<Item = f64>, window: usize) -> Vec<f64> {
    let mut ahead: VecDeque<(usize, f64)> = VecDeque::new();
    let mut least = Vec::with_capacity(values.size_hint().0);
    for (at, value) in values.enumerate() {
        while ahead.back().is_some_and(|(_, last)| *last >= value) {
            ahead.pop_back();
        }
        ahead.push_back((at, value));
        while ahead.front().is_some_and(|(first, _)| first + window < at) {
            ahead.pop_front();
        }
        least.push(ahead.front().map_or(value, |(_, first)| *first));
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// A device of 2 kHz that is 60 ppm slow, whose samples come in parcels of 40, each stamped up to 4 ms late.
    fn stamps(seed: u64, true_s: impl Fn(usize) -> f64) -> Vec<f64> {
        let mut stream = Stream::new(seed, "stamps");
        let mut late_s = 0.0;
        let stamp = |at: usize| {
            if at.is_multiple_of(40) {
                late_s = 4e-3 * stream.uniform();
            }
            true_s(at) + late_s
        };
        (0..60_000).map(stamp).collect()
    }

    fn on_device(at: usize) -> f64 {
        7.0 + at as f64 / 2000.0 * (1.0 + 60e-6)
    }

    #[test]
    fn stamps_that_are_late_in_parcels_and_step_back_between_them_become_even_times() {
        for seed in 0..5 {
            let stamps = stamps(seed, on_device);
            assert!(stamps.windows(2).any(|pair| pair[1] < pair[0]));
            let even = even_times([&*stamps].into_iter(), 2000.0);
            assert!(even.times_s.windows(2).all(|pair| pair[1] > pair[0]));
            let off = |at: usize| even.times_s[at] - on_device(at);
            let worst = (0..60_000).map(off).fold(0.0, |most: f64, off| most.max(off.abs()));
            assert!(worst < 1e-3, "seed {seed}: {worst}");
            assert!((1.5e-3..3e-3).contains(&even.late_rms_s), "{}", even.late_rms_s);
        }
    }

    #[test]
    fn where_samples_were_lost_the_times_step_at_once() {
        let true_s = |at: usize| on_device(if at < 30_000 { at } else { at + 200 });
        let even = even_times([&*stamps(1, true_s)].into_iter(), 2000.0);
        for at in [29_000, 29_999, 30_000, 31_000] {
            assert!(
                (even.times_s[at] - true_s(at)).abs() < 1e-3,
                "sample {at}: {}",
                even.times_s[at] - true_s(at)
            );
        }
        assert!(even.times_s[30_000] - even.times_s[29_999] > 0.099);
    }

    #[test]
    fn stamps_that_are_left_out_do_not_move_the_axis_on_either_side() {
        let mut stamps = stamps(2, on_device);
        stamps[30_000..34_000].iter_mut().for_each(|stamp_s| *stamp_s += 3.0);
        let even = even_times([&stamps[..30_000], &stamps[34_000..]].into_iter(), 2000.0);
        let numbers = (0..30_000).chain(34_000..60_000);
        let worst = numbers
            .zip(&even.times_s)
            .fold(0.0, |most: f64, (at, time)| most.max((time - on_device(at)).abs()));
        assert!(worst < 1e-3, "{worst}");
    }

    #[test]
    fn a_few_samples_have_the_rate_that_the_stream_says() {
        assert_eq!(even_times(std::iter::empty(), 1000.0).times_s, Vec::<f64>::new());
        assert_eq!(even_times([&[3.0][..]].into_iter(), 1000.0).times_s, [3.0]);
    }
}
