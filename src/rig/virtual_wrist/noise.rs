//! Coloured noise: random numbers through second-order sections.

use std::f64::consts::TAU;

use crate::random::Stream;

/// A second-order section (transposed direct form II), after the Audio EQ Cookbook of R. Bristow-Johnson.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Biquad {
    b: [f64; 3],
    a: [f64; 2],
    state: [f64; 2],
}

impl Biquad {
    /// Low-pass with the damping of Butterworth's second order.
    pub fn low_pass(cutoff_hz: f64, sample_rate_hz: f64) -> Self {
        let (cosine, alpha) = Self::angles(cutoff_hz, sample_rate_hz, std::f64::consts::FRAC_1_SQRT_2);
        let edge = (1.0 - cosine) / 2.0;
        Self::normalised([edge, 1.0 - cosine, edge], [1.0 + alpha, -2.0 * cosine, 1.0 - alpha])
    }

    /// High-pass with the damping of Butterworth's second order.
    pub fn high_pass(cutoff_hz: f64, sample_rate_hz: f64) -> Self {
        let (cosine, alpha) = Self::angles(cutoff_hz, sample_rate_hz, std::f64::consts::FRAC_1_SQRT_2);
        let edge = (1.0 + cosine) / 2.0;
        Self::normalised([edge, -1.0 - cosine, edge], [1.0 + alpha, -2.0 * cosine, 1.0 - alpha])
    }

    /// Band-pass from `low_hz` to `high_hz`.
    pub fn band_pass(low_hz: f64, high_hz: f64, sample_rate_hz: f64) -> Self {
        let centre_hz = libm::sqrt(low_hz * high_hz);
        let (cosine, alpha) = Self::angles(centre_hz, sample_rate_hz, centre_hz / (high_hz - low_hz));
        Self::normalised([alpha, 0.0, -alpha], [1.0 + alpha, -2.0 * cosine, 1.0 - alpha])
    }

    fn angles(frequency_hz: f64, sample_rate_hz: f64, quality: f64) -> (f64, f64) {
        let angle = TAU * frequency_hz / sample_rate_hz;
        (libm::cos(angle), libm::sin(angle) / (2.0 * quality))
    }

    fn normalised(b: [f64; 3], a: [f64; 3]) -> Self {
        Self { b: b.map(|weight| weight / a[0]), a: [a[1] / a[0], a[2] / a[0]], state: [0.0; 2] }
    }

    /// The next output.
    #[inline]
    pub fn step(&mut self, input: f64) -> f64 {
        let output = self.b[0] * input + self.state[0];
        self.state[0] = self.b[1] * input - self.a[0] * output + self.state[1];
        self.state[1] = self.b[2] * input - self.a[1] * output;
        output
    }

    /// Sets the state to zero.
    pub fn restart(&mut self) {
        self.state = [0.0; 2];
    }
}

/// Standard deviation of white noise of unit variance behind `sections`.
pub fn noise_gain(mut sections: Vec<Biquad>) -> f64 {
    // Sum the power of the impulse response until it has decayed.
    let mut power = 0.0;
    for sample in 0..1_000_000 {
        let impulse = if sample == 0 { 1.0 } else { 0.0 };
        let output = sections.iter_mut().fold(impulse, |signal, section| section.step(signal));
        power += output * output;
        let left: f64 = sections.iter().flat_map(|section| section.state).map(f64::abs).sum();
        if sample > 0 && left < 1e-12 {
            break;
        }
    }
    libm::sqrt(power)
}

/// An approximately normal random number of unit variance: the sum of four uniform numbers from 64 bits, which is faster than an exact
/// one. A filter behind it sums many of them, and the result is normal for all purposes here.
#[inline]
pub fn cheap_normal(stream: &mut Stream) -> f64 {
    let bits = stream.bits();
    let sum = (bits & 0xFFFF) + (bits >> 16 & 0xFFFF) + (bits >> 32 & 0xFFFF) + (bits >> 48);
    // Four uniform numbers from 0 to 65535: mean 131070, variance 4 (2^32 - 1) / 12.
    (sum as f64 - 131_070.0) * (1.0 / 37_837.227_232_854_32)
}

/// Low-frequency noise, computed at a fraction of the sample rate and interpolated linearly.
#[derive(Debug, Clone)]
pub struct SlowNoise {
    section: Biquad,
    gain: f64,
    every: u32,
    count: u32,
    value: f64,
    slope: f64,
}

impl SlowNoise {
    /// Rate at which the noise is computed, Hz.
    const NODE_RATE_HZ: f64 = 250.0;

    /// Noise of unit variance with the spectrum of `section`, which gets the rate in Hz.
    pub fn new(section: impl Fn(f64) -> Biquad, sample_rate_hz: f64) -> Self {
        let every = (sample_rate_hz / Self::NODE_RATE_HZ).round().max(1.0);
        let section = section(sample_rate_hz / every);
        let gain = 1.0 / noise_gain(vec![section]);
        Self { section, gain, every: every as u32, count: 0, value: 0.0, slope: 0.0 }
    }

    /// The next value.
    #[inline]
    pub fn step(&mut self, stream: &mut Stream) -> f64 {
        if self.count == 0 {
            self.count = self.every;
            let node = self.gain * self.section.step(stream.normal());
            self.slope = (node - self.value) / f64::from(self.every);
        }
        self.count -= 1;
        self.value += self.slope;
        self.value
    }

    /// Sets the state to zero.
    pub fn restart(&mut self) {
        self.section.restart();
        (self.count, self.value, self.slope) = (0, 0.0, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::FRAC_1_SQRT_2;

    use super::*;

    fn deviation(values: &[f64]) -> f64 {
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        libm::sqrt(
            values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>() / values.len() as f64,
        )
    }

    #[test]
    fn cheap_normal_numbers_have_mean_zero_and_variance_one() {
        let mut stream = Stream::new(3, "cheap");
        let values: Vec<f64> = (0..200_000).map(|_| cheap_normal(&mut stream)).collect();
        assert!((values.iter().sum::<f64>() / 2e5).abs() < 0.01);
        assert!((deviation(&values) - 1.0).abs() < 0.01);
    }

    #[test]
    fn slow_noise_has_the_deviation_it_promises() {
        let mut stream = Stream::new(3, "slow");
        for section in [|rate| Biquad::low_pass(2.5, rate), |rate| Biquad::band_pass(8.5, 10.5, rate)] {
            let mut noise = SlowNoise::new(section, 2500.0);
            let values: Vec<f64> = (0..2_000_000).map(|_| noise.step(&mut stream)).collect();
            assert!((deviation(&values) - 1.0).abs() < 0.05, "deviation {}", deviation(&values));
        }
    }

    #[test]
    fn filters_pass_what_they_are_named_for() {
        let gain = |mut filter: Biquad, frequency_hz: f64| {
            let outputs: Vec<f64> = (0..20_000)
                .map(|n| filter.step(libm::sin(TAU * frequency_hz * f64::from(n) / 2500.0)))
                .collect();
            deviation(&outputs[10_000..]) * std::f64::consts::SQRT_2
        };
        assert!((gain(Biquad::low_pass(450.0, 2500.0), 450.0) - FRAC_1_SQRT_2).abs() < 0.01);
        assert!((gain(Biquad::high_pass(20.0, 2500.0), 20.0) - FRAC_1_SQRT_2).abs() < 0.01);
        assert!((gain(Biquad::high_pass(20.0, 2500.0), 200.0) - 1.0).abs() < 0.01);
        assert!((gain(Biquad::band_pass(8.5, 10.5, 2500.0), 9.45) - 1.0).abs() < 0.01);
        assert!(gain(Biquad::band_pass(8.5, 10.5, 2500.0), 2.0) < 0.1);
    }
}
