//! Estimation of a sinusoid of known frequency in a noisy record.

use nalgebra::{Matrix4, Vector4};

/// A sinusoid with its sine and cosine amplitudes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sinusoid {
    /// Frequency, Hz.
    pub hz: f64,
    /// Amplitude of the sine.
    pub sine: f64,
    /// Amplitude of the cosine.
    pub cosine: f64,
}

impl Sinusoid {
    /// The sinusoid of frequency `hz` in `values`, beside a level and a slope, by least squares under a Hann window, which
    /// reduces leakage from slow changes. Time is zero at the last value. `None` if the record is shorter than four periods.
    pub fn fitted(values: &[f64], period_s: f64, hz: f64) -> Option<Self> {
        let count = values.len();
        if (count as f64) * period_s * hz < MIN_PERIODS {
            return None;
        }
        let (mut square, mut right) = (Matrix4::zeros(), Vector4::zeros());
        for (place, value) in values.iter().enumerate() {
            let part = (place as f64 + 0.5) / count as f64;
            let weight = 0.5 - 0.5 * libm::cos(std::f64::consts::TAU * part);
            let phase = std::f64::consts::TAU * hz * (place as f64 + 1.0 - count as f64) * period_s;
            let x = Vector4::new(1.0, part - 0.5, libm::sin(phase), libm::cos(phase));
            square += weight * x * x.transpose();
            right += weight * *value * x;
        }
        let solved = square.cholesky()?.solve(&right);
        Some(Self { hz, sine: solved[2], cosine: solved[3] })
    }

    /// Square of the amplitude.
    pub fn power(&self) -> f64 {
        self.sine * self.sine + self.cosine * self.cosine
    }

    /// Value at a time, s.
    pub fn at(&self, time_s: f64) -> f64 {
        let phase = std::f64::consts::TAU * self.hz * time_s;
        self.sine * libm::sin(phase) + self.cosine * libm::cos(phase)
    }
}

/// Smallest number of periods in which a sinusoid can be distinguished from a slope.
const MIN_PERIODS: f64 = 4.0;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sinusoid_beside_a_slope_is_found_and_continued() {
        let period_s = 1.0 / 2500.0;
        let record = |sample: i32| {
            let time = f64::from(sample) * period_s;
            2.0 + 0.4 * time + 0.03 * libm::sin(std::f64::consts::TAU * 50.0 * time + 0.7)
        };
        let hold: Vec<f64> = (-1249..=0).map(record).collect();
        let found = Sinusoid::fitted(&hold, period_s, 50.0).unwrap();
        assert!((libm::sqrt(found.power()) - 0.03).abs() < 1e-6, "{found:?}");
        let ahead = 60;
        let expected = record(ahead) - 2.0 - 0.4 * f64::from(ahead) * period_s;
        assert!((found.at(f64::from(ahead) * period_s) - expected).abs() < 1e-6);
    }

    #[test]
    fn a_record_of_few_periods_is_refused() {
        assert_eq!(Sinusoid::fitted(&[0.0; 100], 1.0 / 2500.0, 50.0), None);
    }
}
