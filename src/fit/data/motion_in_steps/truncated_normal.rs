//! A normal distribution within an interval.

/// Values beyond so many standard deviations are left out where the interval holds others: they have a part of 1e-18.
const REACH: f64 = 9.0;

/// Number of intervals of Simpson's rule, which is even: the moments are exact to 1e-5.
const SIMPSON_INTERVALS: usize = 64;

/// Moments of a normal distribution that is cut to an interval.
#[derive(Debug, Clone, Copy)]
pub struct TruncatedNormal {
    /// Natural logarithm of the part that lies in the interval.
    pub log_mass: f64,
    /// Mean of that part.
    pub mean: f64,
    /// Variance of that part.
    pub variance: f64,
}

impl TruncatedNormal {
    /// The normal distribution of this mean and variance, from `low` to `high`.
    pub fn new(mean: f64, variance: f64, (low, high): (f64, f64)) -> Self {
        let sd = libm::sqrt(variance);
        let (near, far) = (low.max(mean - REACH * sd), high.min(mean + REACH * sd));
        // Far in a tail, the whole interval.
        let (low, high) = if near < far { (near, far) } else { (low, high) };
        let step = (high - low) / SIMPSON_INTERVALS as f64;
        let at = |place: usize| low + step * place as f64;
        let exponent = |value: f64| -0.5 * (value - mean) * (value - mean) / variance;
        let largest = exponent(mean.clamp(low, high));
        let weight = |place: usize| {
            let simpson = match place {
                0 | SIMPSON_INTERVALS => 1.0,
                own if own % 2 == 1 => 4.0,
                _ => 2.0,
            };
            simpson * step / 3.0 * libm::exp(exponent(at(place)) - largest)
        };
        let (mut mass, mut first) = (0.0, 0.0);
        for place in 0..=SIMPSON_INTERVALS {
            mass += weight(place);
            first += weight(place) * at(place);
        }
        let centre = first / mass;
        let second: f64 = (0..=SIMPSON_INTERVALS)
            .map(|place| weight(place) * (at(place) - centre) * (at(place) - centre))
            .sum();
        let log_density = largest - libm::log(sd) - 0.5 * libm::log(std::f64::consts::TAU);
        Self { log_mass: log_density + libm::log(mass), mean: centre, variance: second / mass }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::statistics::HALF_INTERVAL_95;

    #[test]
    fn a_cut_normal_distribution_has_the_moments_of_the_textbook() {
        // Johnson, Kotz and Balakrishnan 1994: the half from the mean up has the mean sqrt(2/pi) and the variance 1 - 2/pi.
        let half = TruncatedNormal::new(0.0, 1.0, (0.0, 100.0));
        let two_over_pi = 2.0 / std::f64::consts::PI;
        assert!((half.log_mass - libm::log(0.5)).abs() < 1e-5, "{half:?}");
        assert!((half.mean - libm::sqrt(two_over_pi)).abs() < 1e-5, "{half:?}");
        assert!((half.variance - (1.0 - two_over_pi)).abs() < 1e-5, "{half:?}");
        let middle =
            TruncatedNormal::new(3.0, 4.0, (3.0 - 2.0 * HALF_INTERVAL_95, 3.0 + 2.0 * HALF_INTERVAL_95));
        assert!((middle.log_mass - libm::log(0.95)).abs() < 1e-5, "{middle:?}");
    }

    #[test]
    fn a_wide_distribution_is_even_within_the_interval_and_a_far_one_lies_at_its_edge() {
        let even = TruncatedNormal::new(0.2, 1e6, (-0.5, 0.5));
        assert!(even.mean.abs() < 1e-6 && (even.variance - 1.0 / 12.0).abs() < 1e-6, "{even:?}");
        let far = TruncatedNormal::new(50.0, 1.0, (-0.5, 0.5));
        assert!(far.mean > 0.47 && far.variance > 0.0 && far.log_mass < -1200.0, "{far:?}");
    }
}
