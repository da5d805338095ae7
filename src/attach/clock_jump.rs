//! Samples that were lost between two ramps: a step between two clocks, where a line is expected.

use crate::statistics::{SD_BY_MEDIAN, t_two_sided, upper_median};

/// Probability with which a sound recording is said to have a step.
const FALSE_ALARM: f64 = 1e-3;

/// Of a change that a neighbour takes back to less than this part, one ramp was found at another time: the clock did not step.
const TAKEN_BACK: f64 = 0.5;

/// A ramp: its stretch, its time in the session and its time in the recording, s.
pub type RampPair = (usize, f64, f64);

/// A step of a recording's clock against that of the session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ClockStep {
    /// Place of the last ramp before it, among the pairs.
    pub before: usize,
    /// How much later the recording has what comes after it, s.
    pub step_s: f64,
}

/// The steps between the ramps `pairs`, which are in order of time within each stretch; `resolution_s` is what the coarser of the clocks
/// resolves.
///
/// Intervals between neighbours are compared, less the usual speed: a slow change of a quartz stays small in them, a step is in one alone.
/// Its size over the scatter of the intervals, taken from the median of their sizes, is held against Student's t for as many intervals.
pub fn clock_steps(pairs: &[RampPair], resolution_s: f64) -> Vec<ClockStep> {
    let neighbours: Vec<usize> = (1..pairs.len())
        .filter(|at| pairs[*at].0 == pairs[at - 1].0 && pairs[*at].0 != usize::MAX)
        .filter(|at| pairs[*at].1 > pairs[at - 1].1)
        .collect();
    let interval = |at: usize| (pairs[at].1 - pairs[at - 1].1, pairs[at].2 - pairs[at - 1].2);
    if neighbours.len() < 4 {
        return Vec::new();
    }
    let speeds = neighbours.iter().map(|at| interval(*at).1 / interval(*at).0);
    let speed = upper_median(speeds).unwrap_or(f64::NAN);
    let change = |at: usize| interval(at).1 - speed * interval(at).0;
    let size = upper_median(neighbours.iter().map(|at| change(*at).abs())).unwrap_or(f64::NAN);
    // Two rounded times are off by 1/12 of a step's square each.
    let scatter_s = (SD_BY_MEDIAN * size).max(resolution_s / 6.0_f64.sqrt());
    let count = neighbours.len() as f64;
    let is_taken_back = |at: usize| {
        let other = |beside: usize| if neighbours.contains(&beside) { change(beside) } else { 0.0 };
        let own = change(at);
        [other(at - 1), other(at + 1)].iter().any(|other| (own + other).abs() < TAKEN_BACK * own.abs())
    };
    neighbours
        .iter()
        .filter(|at| {
            let p = t_two_sided(change(**at) / scatter_s, count - 1.0);
            count * p < FALSE_ALARM && !is_taken_back(**at)
        })
        .map(|at| ClockStep { before: at - 1, step_s: change(*at) })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Ramps 8 s apart on a clock that is 80 ppm fast and slows down by 1 ppm an hour, to half a millisecond.
    fn ramps(seed: u64, count: usize, off_s: impl Fn(usize) -> f64) -> Vec<RampPair> {
        let mut stream = Stream::new(seed, "ramps");
        let mut session_s = 0.0;
        (0..count)
            .map(|at| {
                session_s += 6.0 + 4.0 * stream.uniform();
                let own_s = 5.0 + session_s * (1.0 + 80e-6 - 1e-6 * session_s / 3600.0) + off_s(at);
                (0, session_s, libm::ceil(own_s / 5e-4) * 5e-4)
            })
            .collect()
    }

    #[test]
    fn a_step_is_found_between_its_ramps_and_sound_clocks_have_none() {
        for count in [8, 40, 200] {
            for seed in 0..50 {
                assert_eq!(clock_steps(&ramps(seed, count, |_| 0.0), 5e-4), [], "{count} ramps, seed {seed}");
                let step = |at| if at >= 5 { -0.02 } else { 0.0 };
                let found = clock_steps(&ramps(seed, count, step), 5e-4);
                assert_eq!(found.len(), 1, "{count} ramps, seed {seed}: {found:?}");
                assert_eq!(found[0].before, 4);
                assert!((found[0].step_s + 0.02).abs() < 1.5e-3, "{found:?}");
            }
        }
    }

    #[test]
    fn one_ramp_at_another_time_is_no_step() {
        let found = clock_steps(&ramps(1, 40, |at| if at == 12 { 0.02 } else { 0.0 }), 5e-4);
        assert_eq!(found, []);
    }
}
