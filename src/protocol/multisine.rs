//! A sum of sines as a motion of the motor: many frequencies at once, from rest to rest.

use std::f64::consts::{PI, TAU};

use super::Motion;

/// Most frequencies of a multisine.
const MOST_LINES: usize = 20;

/// Part of the duration in which the sum is faded in, and as much in which it is faded out.
const FADE_FRACTION: f64 = 0.1;

/// Points in a period of the highest frequency at which the peak of the sum is looked for.
const POINTS_PER_PERIOD: f64 = 32.0;

/// A sum of sines of equal amplitude, faded in and out, whose angle never exceeds its amplitude.
///
/// The frequencies are spread evenly on a logarithmic axis, each a whole number of periods in the duration. The phases are
/// those of Schroeder (1970), which keep the peak of the sum low. The fades are raised cosines over a tenth of the duration
/// each, so that the motor starts and ends at rest at the start position.
///
/// ```
/// use ramphold::protocol::Multisine;
///
/// let multisine = Multisine::new(0.01, [1.0, 60.0], 4.0).unwrap();
/// assert_eq!(multisine.frequencies_hz().next(), Some(1.0));
/// assert_eq!(multisine.at(0.0).angle_rad, 0.0);
/// assert!(multisine.at(1.7).angle_rad.abs() <= 0.01);
/// ```
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Multisine {
    duration_s: f64,
    /// Frequency, Hz, and phase, rad, of each sine.
    lines: [[f64; 2]; MOST_LINES],
    count: usize,
    /// Amplitude of each sine, rad.
    scale_rad: f64,
}

impl Multisine {
    /// The multisine of peak `amplitude_rad` between two frequencies; `None` if no whole number of periods in `duration_s`
    /// lies between them.
    pub fn new(amplitude_rad: f64, [lowest_hz, highest_hz]: [f64; 2], duration_s: f64) -> Option<Self> {
        // A frequency that is a whole number of periods but for rounding counts as one.
        let least = (lowest_hz * duration_s - 1e-9).ceil().max(1.0);
        let most = (highest_hz * duration_s + 1e-9).floor();
        if most.is_nan() || least > most {
            return None;
        }
        let mut lines = [[0.0; 2]; MOST_LINES];
        let mut count = 0;
        let mut last = 0.0;
        for line in 0..MOST_LINES {
            let way = line as f64 / (MOST_LINES - 1) as f64;
            let periods = (least * libm::exp(way * libm::log(most / least))).round();
            if periods > last {
                lines[count][0] = periods / duration_s;
                (last, count) = (periods, count + 1);
            }
        }
        for (line, own) in lines[..count].iter_mut().enumerate() {
            own[1] = -PI * (line * (line + 1)) as f64 / count as f64;
        }
        let mut multisine = Self { duration_s, lines, count, scale_rad: 1.0 };
        multisine.scale_rad = amplitude_rad / multisine.highest_sum(most);
        Some(multisine)
    }

    /// A bound of the sum of the sines, each of amplitude 1: the highest of its samples, and as much more as a sum of sines
    /// can rise between samples that close.
    fn highest_sum(&self, periods: f64) -> f64 {
        let points = (POINTS_PER_PERIOD * periods).ceil();
        let sums =
            (0..points as u64).map(|point| self.sum(point as f64 / points * self.duration_s).angle_rad);
        sums.map(f64::abs).fold(0.0, f64::max) / libm::cos(PI / POINTS_PER_PERIOD)
    }

    /// Duration from rest to rest, s.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// The frequencies, Hz, the lowest first.
    pub fn frequencies_hz(&self) -> impl ExactSizeIterator<Item = f64> {
        self.lines[..self.count].iter().map(|[frequency_hz, _]| *frequency_hz)
    }

    /// Where the motor is `t_s` after the start; at rest at the start position before and after.
    pub fn at(&self, t_s: f64) -> Motion {
        if t_s <= 0.0 || t_s >= self.duration_s {
            return Motion::default();
        }
        let (sum, fade) = (self.sum(t_s), self.fade(t_s));
        Motion {
            angle_rad: fade.angle_rad * sum.angle_rad,
            velocity_rad_s: fade.angle_rad * sum.velocity_rad_s + fade.velocity_rad_s * sum.angle_rad,
            acceleration_rad_s2: fade.angle_rad * sum.acceleration_rad_s2
                + 2.0 * fade.velocity_rad_s * sum.velocity_rad_s
                + fade.acceleration_rad_s2 * sum.angle_rad,
        }
    }

    /// The sum without the fades, and its derivatives.
    fn sum(&self, t_s: f64) -> Motion {
        let mut sum = Motion::default();
        for [frequency_hz, phase_rad] in &self.lines[..self.count] {
            let omega = TAU * frequency_hz;
            let angle = omega * t_s + phase_rad;
            let (sine, cosine) = (self.scale_rad * libm::sin(angle), self.scale_rad * libm::cos(angle));
            sum.angle_rad += sine;
            sum.velocity_rad_s += omega * cosine;
            sum.acceleration_rad_s2 -= omega * omega * sine;
        }
        sum
    }

    /// The fade, 0 to 1, as the angle, and its derivatives.
    fn fade(&self, t_s: f64) -> Motion {
        let fade_s = FADE_FRACTION * self.duration_s;
        let (from_edge_s, direction) =
            if t_s < 0.5 * self.duration_s { (t_s, 1.0) } else { (self.duration_s - t_s, -1.0) };
        if from_edge_s >= fade_s {
            return Motion { angle_rad: 1.0, ..Motion::default() };
        }
        let rate = PI / fade_s;
        let phase = rate * from_edge_s;
        Motion {
            angle_rad: 0.5 * (1.0 - libm::cos(phase)),
            velocity_rad_s: direction * 0.5 * rate * libm::sin(phase),
            acceleration_rad_s2: 0.5 * rate * rate * libm::cos(phase),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn frequencies_are_whole_numbers_of_periods_spread_evenly_on_a_logarithmic_axis() {
        let multisine = Multisine::new(0.01, [1.0, 60.0], 4.0).unwrap();
        let lines: Vec<f64> = multisine.frequencies_hz().collect();
        assert_eq!((lines[0], lines[lines.len() - 1]), (1.0, 60.0));
        assert!(lines.iter().all(|frequency_hz| (frequency_hz * 4.0).fract() == 0.0), "{lines:?}");
        for pair in lines.windows(2).filter(|pair| pair[0] > 5.0) {
            assert!((pair[1] / pair[0] - 60f64.powf(1.0 / 19.0)).abs() < 0.05, "{pair:?}");
        }
    }

    #[test]
    fn two_frequencies_without_a_whole_period_between_them_make_no_multisine() {
        assert_eq!(Multisine::new(0.01, [1.1, 1.2], 4.0), None);
        assert_eq!(Multisine::new(0.01, [2.0, 1.0], 4.0), None);
        assert_eq!(Multisine::new(0.01, [1.0, f64::NAN], 4.0), None);
        assert_eq!(Multisine::new(0.01, [1.0, 1.0], 4.0).unwrap().frequencies_hz().len(), 1);
    }

    #[test]
    fn the_phases_keep_the_peak_lower_than_a_sum_in_phase_would_have_it() {
        let multisine = Multisine::new(1.0, [1.0, 60.0], 4.0).unwrap();
        // In phase, the amplitudes of the sines would add up to the peak.
        let sum = multisine.scale_rad * multisine.count as f64;
        assert!(sum > 1.5, "{sum}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn the_angle_stays_within_the_amplitude_and_speed_and_acceleration_are_its_derivatives(
            lowest in 0.3..3.0f64, octaves in 0.0..6.0f64, duration in 4.0..8.0f64, part in 0.0..1.0f64,
        ) {
            let Some(multisine) = Multisine::new(0.01, [lowest, lowest * octaves.exp2()], duration) else {
                return Ok(());
            };
            let h = 1e-6;
            let t_s = part * duration;
            let (before, now, after) = (multisine.at(t_s - h), multisine.at(t_s), multisine.at(t_s + h));
            prop_assert!(now.angle_rad.abs() <= 0.01);
            let speed = (after.angle_rad - before.angle_rad) / (2.0 * h);
            prop_assert!((speed - now.velocity_rad_s).abs() < 1e-4);
            let fade_s = FADE_FRACTION * duration;
            // The acceleration has a step where a fade begins and ends.
            let is_smooth = [0.0, fade_s, duration - fade_s, duration].iter().all(|edge| (t_s - edge).abs() > 2.0 * h);
            if is_smooth {
                let acceleration = (after.velocity_rad_s - before.velocity_rad_s) / (2.0 * h);
                prop_assert!((acceleration - now.acceleration_rad_s2).abs() < 0.1);
            }
        }
    }

    #[test]
    fn it_starts_and_ends_at_rest() {
        let multisine = Multisine::new(0.01, [1.0, 60.0], 4.0).unwrap();
        for t_s in [-1.0, 0.0, 4.0, 5.0] {
            assert_eq!(multisine.at(t_s), Motion::default());
        }
        for t_s in [1e-6, 4.0 - 1e-6] {
            let motion = multisine.at(t_s);
            assert!(motion.angle_rad.abs() < 1e-12 && motion.velocity_rad_s.abs() < 1e-5, "{motion:?}");
        }
    }
}
