//! Noise of a channel with the motor at rest: its spectrum, from the rests before the motions and from trials without motion.

use rustfft::FftPlanner;
use rustfft::num_complex::Complex64;

/// Length of the long segments, s; they tell the noise below 10 Hz.
const LONG_S: f64 = 1.0;

/// Values of a spectrum, at one frequency of one segment each, that are averaged at least: their mean is then known to some 20 %.
const AVERAGED: usize = 24;

/// A one-sided spectrum of power, constant below its lowest frequency and above its highest.
#[derive(Debug, Clone, PartialEq)]
pub struct PowerSpectrum {
    /// Frequencies, Hz.
    pub frequency_hz: Vec<f64>,
    /// Power at each, in the square of the channel's unit for each Hz.
    pub power_per_hz: Vec<f64>,
}

impl PowerSpectrum {
    /// The spectrum of stretches of noise, by Welch's method: segments of two lengths with half overlap, a Hann window, and the mean
    /// taken out. Frequencies that only the long segments resolve are theirs. `short_s` is a length that every stretch has.
    pub fn of_stretches(stretches: &[&[f64]], sample_rate_hz: f64, short_s: f64) -> Self {
        let short = welch(stretches, (short_s * sample_rate_hz) as usize, sample_rate_hz);
        let long = welch(stretches, (LONG_S * sample_rate_hz) as usize, sample_rate_hz);
        // A Hann window mixes a frequency with its two neighbours: the first two steps above zero are not resolved.
        let from_hz = 2.0 / short_s;
        let (mut frequency_hz, mut power_per_hz) = (Vec::new(), Vec::new());
        let low = long.iter().skip(2).filter(|(hz, _)| *hz < from_hz);
        for (hz, power) in low.chain(short.iter().skip(2)) {
            frequency_hz.push(*hz);
            power_per_hz.push(*power);
        }
        Self { frequency_hz, power_per_hz }
    }

    /// The larger one of two spectra at each frequency of both.
    pub fn larger(&self, other: &Self) -> Self {
        let mut frequency_hz: Vec<f64> =
            self.frequency_hz.iter().chain(&other.frequency_hz).copied().collect();
        frequency_hz.sort_by(f64::total_cmp);
        frequency_hz.dedup();
        let power_per_hz = frequency_hz.iter().map(|hz| self.at(*hz).max(other.at(*hz))).collect();
        Self { frequency_hz, power_per_hz }
    }

    /// Power at a frequency, linear between the frequencies of the spectrum.
    pub fn at(&self, hz: f64) -> f64 {
        let above = self.frequency_hz.partition_point(|own| *own < hz);
        match (above.checked_sub(1), self.frequency_hz.get(above)) {
            (None, None) => 0.0,
            (None, Some(_)) => self.power_per_hz[0],
            (Some(last), None) => self.power_per_hz[last],
            (Some(below), Some(_)) => {
                let (low, high) = (self.frequency_hz[below], self.frequency_hz[above]);
                let part = (hz - low) / (high - low);
                self.power_per_hz[below] * (1.0 - part) + self.power_per_hz[above] * part
            }
        }
    }
}

/// Frequencies and powers of all segments of one length together; empty if no stretch is that long.
fn welch(stretches: &[&[f64]], length: usize, sample_rate_hz: f64) -> Vec<(f64, f64)> {
    if length < 8 {
        return Vec::new();
    }
    let window: Vec<f64> = (0..length)
        .map(|place| 0.5 - 0.5 * libm::cos(std::f64::consts::TAU * place as f64 / length as f64))
        .collect();
    let weight: f64 = window.iter().map(|own| own * own).sum();
    let transform = FftPlanner::new().plan_fft_forward(length);
    let mut sums = vec![0.0; length / 2];
    let mut segments: usize = 0;
    for stretch in stretches {
        for start in (0..(stretch.len() + 1).saturating_sub(length)).step_by(length / 2) {
            let segment = &stretch[start..start + length];
            let mean = segment.iter().sum::<f64>() / length as f64;
            let mut buffer: Vec<Complex64> = segment
                .iter()
                .zip(&window)
                .map(|(value, weight)| Complex64::new((value - mean) * weight, 0.0))
                .collect();
            transform.process(&mut buffer);
            for (sum, value) in sums.iter_mut().zip(&buffer) {
                *sum += value.norm_sqr();
            }
            segments += 1;
        }
    }
    if segments == 0 {
        return Vec::new();
    }
    let scale = 2.0 / (sample_rate_hz * weight * segments as f64);
    let hz = |place: usize| place as f64 * sample_rate_hz / length as f64;
    // Few segments: neighbouring frequencies are averaged as well. The lowest two are not noise but the mean that was taken out.
    let beside = AVERAGED.div_ceil(segments) / 2;
    let smooth = |place: usize| {
        let near =
            &sums[place.saturating_sub(beside).max(2.min(place))..(place + beside + 1).min(sums.len())];
        near.iter().sum::<f64>() / near.len() as f64
    };
    (0..sums.len()).map(|place| (hz(place), smooth(place) * scale)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    #[test]
    fn white_noise_has_its_variance_over_half_the_sample_rate() {
        let mut stream = Stream::new(5, "noise");
        let noise: Vec<f64> = (0..40_000).map(|_| 0.1 * stream.normal()).collect();
        let stretches: Vec<&[f64]> = noise.chunks(4000).collect();
        let spectrum = PowerSpectrum::of_stretches(&stretches, 2000.0, 0.2);
        let expected = 0.01 / 1000.0;
        for hz in [3.0, 20.0, 100.0, 600.0] {
            let near: f64 = (0..11).map(|step| spectrum.at(hz + f64::from(step))).sum::<f64>() / 11.0;
            assert!((near / expected - 1.0).abs() < 0.25, "{hz} Hz: {near}");
        }
    }
}
