//! Whether the times of a record are those of samples taken evenly, which every analysis takes them for.

use std::ops::Range;

use crate::statistics::upper_median;

/// How far a step of time may be from a period, in periods: beyond it, a sample is nearer to the place of its neighbour.
pub const STEP_TOLERANCE: f64 = 0.5;

/// Times have to be even over what is analysed together, s: 40 ms before and after an onset. The clock of a recording may drift slowly.
const TOGETHER_S: f64 = 0.080;

/// Fewest samples of which it can be told whether they are even.
const FEWEST: usize = 16;

/// Time errors up to this size, in periods, are left alone. Fitted stiffness is off by up to 136 % if the times of a session at
/// 2500 Hz are off by up to an eighth of a period, and its error goes with their square: by 1 % at a hundredth of a period.
const HARMLESS: f64 = 0.01;

/// The fastest motion of a stretch is measured over this time, s, longer than the noise of an encoder.
const SPEED_OVER_S: f64 = 0.008;

/// Most decimal digits behind the point that times are looked at for.
const MOST_DIGITS: i32 = 9;

/// A sample that was not taken when an even axis has it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnevenTime {
    /// Place of the sample in the record, from 0.
    pub sample: usize,
    /// By how much its time is off the nearest even axis, s, beyond what rounding explains.
    pub off_s: f64,
    /// How far the angle moves in that time where the motor is fastest near it, rad.
    pub moved_rad: f64,
}

/// The sample that does not follow the one before it by a step of `period_s`, within half of that or what a step between times that are
/// rounded to multiples of `grain_s` can be off by: less than one of them.
pub fn uneven_step(times_s: &[f64], period_s: f64, grain_s: f64) -> Option<usize> {
    let tolerance_s = (STEP_TOLERANCE * period_s).max(grain_s * (1.0 - 1e-6));
    let is_even = |pair: &[f64]| (pair[1] - pair[0] - period_s).abs() <= tolerance_s;
    times_s.windows(2).position(|pair| !is_even(pair)).map(|before| before + 1)
}

/// The worst sample of the first stretch whose times are off an even axis by more than what rounding to multiples of `grain_s` explains
/// and what does harm: more than a hundredth of a period, in which the angle moves by more than it is known to. A clock that drifts
/// has an even axis in each stretch.
pub fn uneven_time(
    times_s: &[f64],
    theta_rad: &[f64],
    period_s: f64,
    grain_s: impl FnOnce() -> f64,
) -> Option<UnevenTime> {
    let count = times_s.len().min(theta_rad.len());
    if count < FEWEST {
        return None;
    }
    // Most records lie on one even axis as they are.
    let step_s = (times_s[count - 1] - times_s[0]) / (count - 1) as f64;
    let off = |sample: usize| (times_s[sample] - times_s[0] - sample as f64 * step_s).abs();
    if (0..count).all(|sample| off(sample) <= HARMLESS * period_s) {
        return None;
    }
    let half_grain_s = 0.5 * grain_s();
    let length = (libm::round(TOGETHER_S / period_s) as usize).clamp(FEWEST, count);
    let starts = (0..count - length).step_by(length / 2).chain([count - length]);
    let mut known_rad = None;
    for stretch in starts.map(|start| start..start + length) {
        let beyond = |off_s: f64| off_s - half_grain_s;
        let limit_s = HARMLESS * period_s;
        // An axis through both ends is no nearer than the nearest.
        let ends_s = (times_s[stretch.end - 1] - times_s[stretch.start]) / (length - 1) as f64;
        if beyond(half_range(times_s, &stretch, ends_s)) <= limit_s {
            continue;
        }
        let step_s = nearest_step(times_s, &stretch, ends_s);
        let off_s = beyond(half_range(times_s, &stretch, step_s));
        if off_s <= limit_s {
            continue;
        }
        let moved_rad = off_s * fastest(&theta_rad[stretch.clone()], period_s);
        let known_rad = *known_rad.get_or_insert_with(|| known_to(&theta_rad[..count], length));
        if moved_rad > known_rad {
            let sample = farthest(times_s, &stretch, step_s);
            return Some(UnevenTime { sample, off_s, moved_rad });
        }
    }
    None
}

/// The largest time of which all of `times` are multiples, as printed with few digits or stored in single precision; in any case that
/// of a number of double precision.
pub fn grain(times: &[f64]) -> f64 {
    let largest = times.iter().fold(0.0_f64, |largest, time| largest.max(time.abs()));
    let double = largest * f64::EPSILON;
    let holds = |grain: &f64| {
        times.iter().all(|time| {
            let multiple = time / grain;
            (multiple - libm::round(multiple)).abs() <= 4.0 * f64::EPSILON * multiple.abs().max(1.0)
        })
    };
    let decades = (0..=MOST_DIGITS).map(|digits| 10.0_f64.powi(digits));
    let decimal =
        decades.flat_map(|decade| [5.0, 2.0, 1.0].map(|first| first / decade)).find(holds).unwrap_or(0.0);
    let is_single = times.iter().all(|time| f64::from(*time as f32) == *time);
    let single = if is_single { largest * f64::from(f32::EPSILON) } else { 0.0 };
    double.max(decimal).max(single)
}

/// What is left of the times of a stretch beside steps of `step_s`, s: the least and the most.
fn left_over(times_s: &[f64], stretch: &Range<usize>, step_s: f64) -> (f64, f64) {
    let left = stretch
        .clone()
        .map(|sample| times_s[sample] - times_s[stretch.start] - (sample - stretch.start) as f64 * step_s);
    left.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), own| (least.min(own), most.max(own)))
}

/// By how much the times of a stretch are off the nearest axis of this step, s.
fn half_range(times_s: &[f64], stretch: &Range<usize>, step_s: f64) -> f64 {
    let (least, most) = left_over(times_s, stretch, step_s);
    0.5 * (most - least)
}

/// The sample that is farthest from the middle of what is left over.
fn farthest(times_s: &[f64], stretch: &Range<usize>, step_s: f64) -> usize {
    let (least, most) = left_over(times_s, stretch, step_s);
    let off = |sample: usize| {
        let own = times_s[sample] - times_s[stretch.start] - (sample - stretch.start) as f64 * step_s;
        (own - 0.5 * (least + most)).abs()
    };
    stretch.clone().max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(stretch.start)
}

/// The step of the nearest even axis, s. How far off the times are is a convex function of the step, so it is found by thirds.
fn nearest_step(times_s: &[f64], stretch: &Range<usize>, ends_s: f64) -> f64 {
    // Both ends are off by no more than all are, in either direction.
    let reach = 4.0 * half_range(times_s, stretch, ends_s) / (stretch.len() - 1) as f64;
    let (mut low, mut high) = (ends_s - reach, ends_s + reach);
    for _ in 0..40 {
        let third = (high - low) / 3.0;
        let (a, b) = (low + third, high - third);
        if half_range(times_s, stretch, a) <= half_range(times_s, stretch, b) { high = b } else { low = a }
    }
    0.5 * (low + high)
}

/// The fastest motion in a stretch, rad/s.
fn fastest(theta_rad: &[f64], period_s: f64) -> f64 {
    let span = (libm::round(SPEED_OVER_S / period_s) as usize).clamp(1, theta_rad.len() - 1);
    let ways = theta_rad.windows(span + 1).map(|own| (own[span] - own[0]).abs());
    ways.fold(0.0, f64::max) / (span as f64 * period_s)
}

/// How well an angle is known, rad: to half the step of its encoder, or to its noise where that is larger. The noise is that of most
/// stretches: a motor holds for longer than it moves.
fn known_to(theta_rad: &[f64], length: usize) -> f64 {
    let steps = theta_rad.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
    let step = steps.fold(f64::INFINITY, f64::min);
    // The second difference of white noise has six times its variance.
    let noise = theta_rad.chunks(length).filter(|own| own.len() > 2).map(|own| {
        let squares = own.windows(3).map(|own| (own[2] - 2.0 * own[1] + own[0]).powi(2)).sum::<f64>();
        libm::sqrt(squares / (6 * (own.len() - 2)) as f64)
    });
    let noise = upper_median(noise).filter(|noise| noise.is_finite()).unwrap_or(0.0);
    if step.is_finite() { noise.max(0.5 * step) } else { noise }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const PERIOD_S: f64 = 1.0 / 2500.0;
    const SAMPLES: usize = 2500;

    /// A ramp that rises to 3.25 rad/s after a hold of half a second, on an encoder of 131072 counts.
    fn ramp() -> Vec<f64> {
        let count_rad = std::f64::consts::TAU / 131_072.0;
        let way = |time_s: f64| if time_s < 0.016 { time_s * time_s / 0.032 } else { time_s - 0.008 };
        let angle = |sample: usize| (3.25 * way((sample as f64 * PERIOD_S - 0.5).max(0.0))).min(0.14);
        (0..SAMPLES).map(|sample| libm::round(angle(sample) / count_rad) * count_rad).collect()
    }

    fn even(sample: usize) -> f64 {
        sample as f64 * PERIOD_S
    }

    fn found(times_s: &[f64]) -> Option<UnevenTime> {
        uneven_time(times_s, &ramp(), PERIOD_S, || grain(times_s))
    }

    fn printed(time_s: f64, digits: i32) -> f64 {
        let factor = 10.0_f64.powi(digits);
        libm::round(time_s * factor) / factor
    }

    #[test]
    fn jitter_that_moves_the_angle_of_the_ramp_is_found_there() {
        for amplitude_s in [2e-5, 5e-5, 1.6e-4] {
            let mut random = Stream::new(3, "jitter");
            let mut jittered = |sample: usize| even(sample) + amplitude_s * (2.0 * random.uniform() - 1.0);
            let times_s: Vec<f64> = (0..SAMPLES).map(|sample| printed(jittered(sample), 7)).collect();
            let found = found(&times_s).unwrap();
            assert!((1050..1600).contains(&found.sample), "{found:?}");
            assert!(found.off_s > 0.8 * amplitude_s && found.off_s < amplitude_s, "{found:?}");
            assert!(uneven_time(&times_s, &vec![0.1; SAMPLES], PERIOD_S, || 0.0).is_none(), "at rest");
        }
    }

    #[test]
    fn what_rounding_explains_is_even() {
        for period_s in [PERIOD_S, 1.0 / 3000.0, 1.0 / 2048.0] {
            for digits in [3, 4, 5, 6] {
                let times_s: Vec<f64> =
                    (0..SAMPLES).map(|sample| printed(sample as f64 * period_s, digits)).collect();
                let even = uneven_time(&times_s, &ramp(), period_s, || grain(&times_s));
                assert_eq!(even, None, "{period_s} s with {digits} digits");
            }
            let single = |sample: usize| f64::from((600.0 + sample as f64 * period_s) as f32);
            let times_s: Vec<f64> = (0..SAMPLES).map(single).collect();
            assert_eq!(uneven_time(&times_s, &ramp(), period_s, || grain(&times_s)), None);
        }
    }

    #[test]
    fn a_clock_that_drifts_has_another_rate_and_no_jitter() {
        let drifting = |sample: usize| even(sample) * (1.0 + 5e-4 * even(sample));
        assert_eq!(found(&(0..SAMPLES).map(drifting).collect::<Vec<_>>()), None);
    }

    #[test]
    fn a_jitter_that_the_encoder_hides_is_left_alone() {
        let mut random = Stream::new(4, "jitter");
        let times_s: Vec<f64> =
            (0..SAMPLES).map(|sample| even(sample) + 5e-6 * (2.0 * random.uniform() - 1.0)).collect();
        assert_eq!(found(&times_s), None);
    }

    #[test]
    fn a_lost_sample_shows_in_whole_milliseconds_too() {
        let lost: Vec<f64> =
            (0..SAMPLES).map(|sample| printed(even(sample + usize::from(sample > 1300)), 3)).collect();
        assert_eq!(uneven_step(&lost, PERIOD_S, grain(&lost)), None, "no step is too large for the digits");
        let found = found(&lost).unwrap();
        assert!((1100..1500).contains(&found.sample), "{found:?}");
    }

    #[test]
    fn a_step_of_another_length_is_found_where_it_is() {
        let mut times_s: Vec<f64> = (0..SAMPLES).map(even).collect();
        assert_eq!(uneven_step(&times_s, PERIOD_S, 1e-7), None);
        times_s.iter_mut().skip(700).for_each(|time| *time += PERIOD_S);
        assert_eq!(uneven_step(&times_s, PERIOD_S, 1e-7), Some(700));
        times_s[300] = times_s[299];
        assert_eq!(uneven_step(&times_s, PERIOD_S, 1e-7), Some(300));
        times_s[100] = f64::NAN;
        assert_eq!(uneven_step(&times_s, PERIOD_S, 1e-7), Some(100));
    }
}
