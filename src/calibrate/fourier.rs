//! Fourier coefficients of a record below a highest frequency, and the way back to a coarser time axis.

use std::sync::Arc;

use rustfft::num_complex::Complex64;
use rustfft::{Fft, FftPlanner};

/// Points of the time axis of [`Fourier::to_time`] for each coefficient, at least. The cube of a torque has three times its frequencies; a
/// friction that changes its direction has many more, which must not be folded back.
const POINTS_PER_COEFFICIENT: usize = 8;

/// The transforms of records of one length.
#[derive(Clone)]
pub struct Fourier {
    record: Arc<dyn Fft<f64>>,
    to_record: Arc<dyn Fft<f64>>,
    forward: Arc<dyn Fft<f64>>,
    inverse: Arc<dyn Fft<f64>>,
    samples: usize,
    /// Number of coefficients, from frequency 0 up.
    pub coefficients: usize,
    /// Distance between two coefficients, Hz.
    pub step_hz: f64,
}

impl Fourier {
    /// The transforms of records with `samples` samples; coefficients from 0 up to `top_hz`.
    pub fn new(samples: usize, sample_rate_hz: f64, top_hz: f64) -> Self {
        let step_hz = sample_rate_hz / samples as f64;
        let coefficients = ((top_hz / step_hz).floor() as usize + 1).min(samples / 2);
        let points = quickly_transformed(POINTS_PER_COEFFICIENT * coefficients);
        let mut planner = FftPlanner::new();
        Self {
            record: planner.plan_fft_forward(samples),
            to_record: planner.plan_fft_inverse(samples),
            forward: planner.plan_fft_forward(points),
            inverse: planner.plan_fft_inverse(points),
            samples,
            coefficients,
            step_hz,
        }
    }

    /// Angular frequency of a coefficient, rad/s.
    pub fn omega(&self, coefficient: usize) -> f64 {
        std::f64::consts::TAU * self.frequency_hz(coefficient)
    }

    /// Samples a second of the record.
    pub fn sample_rate_hz(&self) -> f64 {
        self.step_hz * self.samples as f64
    }

    /// Time between two points of the coarser time axis, s.
    pub fn time_step_s(&self) -> f64 {
        1.0 / (self.step_hz * self.inverse.len() as f64)
    }

    /// Frequency of a coefficient, Hz.
    pub fn frequency_hz(&self, coefficient: usize) -> f64 {
        self.step_hz * coefficient as f64
    }

    /// Coefficients of a record; that of frequency 0 is its mean.
    pub fn of_record(&self, record: &[f64]) -> Vec<Complex64> {
        self.transformed(&*self.record, record, self.samples)
    }

    /// Coefficients of values on the coarser time axis.
    pub fn of_time(&self, values: &[f64]) -> Vec<Complex64> {
        self.transformed(&*self.forward, values, values.len())
    }

    /// As [`Fourier::to_time`], of two signals by one transform: one is its real part, the other its imaginary part.
    pub fn to_time_pairs(&self, signals: &[[Complex64; 2]]) -> Vec<[f64; 2]> {
        let points = self.inverse.len();
        let mut buffer = vec![Complex64::ZERO; points];
        for (place, [one, other]) in signals.iter().enumerate() {
            buffer[place] = one + Complex64::I * other;
            if place > 0 {
                buffer[points - place] = one.conj() + Complex64::I * other.conj();
            }
        }
        self.inverse.process(&mut buffer);
        buffer.iter().map(|value| [value.re, value.im]).collect()
    }

    /// As [`Fourier::of_time`], of two signals by one transform.
    pub fn of_time_pairs(&self, values: impl Iterator<Item = [f64; 2]>) -> Vec<[Complex64; 2]> {
        let mut buffer: Vec<Complex64> = values.map(|[one, other]| Complex64::new(one, other)).collect();
        self.forward.process(&mut buffer);
        let points = buffer.len();
        let pair = |place: usize| {
            let (own, mirrored) = (buffer[place], buffer[(points - place) % points].conj());
            let half = 0.5 / points as f64;
            [half * (own + mirrored), -half * Complex64::I * (own - mirrored)]
        };
        (0..self.coefficients).map(pair).collect()
    }

    fn transformed(&self, transform: &dyn Fft<f64>, values: &[f64], count: usize) -> Vec<Complex64> {
        let mut buffer: Vec<Complex64> = values.iter().map(|value| Complex64::new(*value, 0.0)).collect();
        transform.process(&mut buffer);
        buffer.truncate(self.coefficients);
        buffer.iter().map(|value| value / count as f64).collect()
    }

    /// Values of a signal with these coefficients at the samples of the record.
    pub fn to_record(&self, coefficients: &[Complex64]) -> Vec<f64> {
        on_axis(&*self.to_record, coefficients, self.samples)
    }

    /// Values of a signal with these coefficients on the coarser time axis.
    pub fn to_time(&self, coefficients: &[Complex64]) -> Vec<f64> {
        on_axis(&*self.inverse, coefficients, self.inverse.len())
    }
}

/// The least of the lengths 2^k, 5/8 2^k and 3/4 2^k, whose transforms are quick, that is no less than a length.
fn quickly_transformed(least: usize) -> usize {
    let power = least.next_power_of_two();
    [power / 8 * 5, power / 4 * 3].into_iter().find(|length| *length >= least).unwrap_or(power)
}

fn on_axis(inverse: &dyn Fft<f64>, coefficients: &[Complex64], points: usize) -> Vec<f64> {
    let mut buffer = vec![Complex64::ZERO; points];
    for (place, value) in coefficients.iter().enumerate() {
        buffer[place] = *value;
        if place > 0 {
            buffer[points - place] = value.conj();
        }
    }
    inverse.process(&mut buffer);
    buffer.iter().map(|value| value.re).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lengths_are_no_less_than_asked_for_and_transform_quickly() {
        let lengths = [1, 2, 9, 100, 640, 641, 8192, 8193].map(quickly_transformed);
        assert_eq!(lengths, [1, 2, 10, 128, 640, 768, 8192, 10_240]);
    }

    #[test]
    fn a_sine_has_one_coefficient_and_comes_back() {
        let fourier = Fourier::new(1000, 500.0, 40.0);
        let wave = |time_s: f64| 0.3 + 2.0 * libm::sin(std::f64::consts::TAU * 10.0 * time_s);
        let record: Vec<f64> = (0..1000).map(|sample| wave(f64::from(sample) / 500.0)).collect();
        let found = fourier.of_record(&record);
        assert!((found[0].re - 0.3).abs() < 1e-12 && (found[20] - Complex64::new(0.0, -1.0)).norm() < 1e-12);
        let values = fourier.to_time(&found);
        for (place, value) in values.iter().enumerate() {
            let time_s = 2.0 * place as f64 / values.len() as f64;
            assert!((value - wave(time_s)).abs() < 1e-9);
        }
        let again = fourier.of_time(&values);
        assert!(again.iter().zip(&found).all(|(a, b)| (a - b).norm() < 1e-12));
        let mut other: Vec<Complex64> = found.iter().map(|value| 0.5 * Complex64::I * value).collect();
        other[0] = Complex64::new(0.1, 0.0);
        let pairs: Vec<[Complex64; 2]> = found.iter().zip(&other).map(|(a, b)| [*a, *b]).collect();
        let in_time = fourier.to_time_pairs(&pairs);
        let alone = fourier.to_time(&other);
        assert!(
            in_time
                .iter()
                .zip(values.iter().zip(&alone))
                .all(|(pair, (a, b))| (pair[0] - a).abs() + (pair[1] - b).abs() < 1e-12)
        );
        let again = fourier.of_time_pairs(in_time.into_iter());
        assert!(
            again
                .iter()
                .zip(&pairs)
                .skip(1)
                .all(|(a, b)| (a[0] - b[0]).norm() + (a[1] - b[1]).norm() < 1e-12)
        );
        assert!(fourier.to_record(&found).iter().zip(&record).all(|(a, b)| (a - b).abs() < 1e-9));
    }
}
