//! Times of samples: a loop has them late, never early, and several at once where a frame carries several.

/// Samples over which the least late one is looked for: a second.
const WINDOW_S: f64 = 1.0;

/// Times of the samples of a steady clock, from the times at which they were had.
#[derive(Debug, Clone)]
pub struct SampleClock {
    period_s: f64,
    /// Lateness of the least late sample in the last window and in this one, s, on the time axis of the samples.
    least_s: [f64; 2],
    in_window: u64,
    window: u64,
    last_sample: Option<u64>,
}

impl SampleClock {
    /// A clock of `rate_hz` samples a second.
    pub fn new(rate_hz: f64) -> Self {
        Self {
            period_s: 1.0 / rate_hz,
            least_s: [f64::INFINITY; 2],
            in_window: 0,
            window: (WINDOW_S * rate_hz) as u64,
            last_sample: None,
        }
    }

    /// Time of sample number `sample`, which was had at `had_s`.
    pub fn time_s(&mut self, sample: u64, had_s: f64) -> f64 {
        // After a stretch without power nothing is known of the samples before.
        if self.last_sample.is_none_or(|last| sample != last + 1) {
            self.least_s = [f64::INFINITY; 2];
            self.in_window = 0;
        }
        self.last_sample = Some(sample);
        let on_axis_s = sample as f64 * self.period_s;
        if self.in_window == self.window {
            self.least_s = [self.least_s[1], f64::INFINITY];
            self.in_window = 0;
        }
        self.in_window += 1;
        self.least_s[1] = self.least_s[1].min(had_s - on_axis_s);
        on_axis_s + self.least_s[0].min(self.least_s[1])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_that_come_four_at_a_time_and_late_get_even_times() {
        let mut clock = SampleClock::new(2500.0);
        let mut before = None;
        for sample in 0..50_000u64 {
            // A crystal that is 50 ppm slow, frames of four, and a loop that is up to 0.9 ms late.
            let measured_s = 7.0 + (sample / 4 * 4 + 3) as f64 * 4e-4 * 1.000_05;
            let late_s = 1e-3 * ((sample / 4 * 7919 % 97) as f64 / 108.0);
            let time_s = clock.time_s(sample, measured_s + late_s);
            let true_s = 7.0 + sample as f64 * 4e-4 * 1.000_05;
            if sample > 2500 {
                assert!((time_s - true_s).abs() < 2e-4, "sample {sample}: {}", time_s - true_s);
                let step_s = time_s - before.unwrap_or(time_s - 4e-4);
                assert!((step_s - 4e-4).abs() < 2e-4, "sample {sample}: step {step_s}");
            }
            before = Some(time_s);
        }
    }

    #[test]
    fn after_a_break_the_times_begin_anew() {
        let mut clock = SampleClock::new(1000.0);
        for sample in 0..100 {
            clock.time_s(sample, sample as f64 * 1e-3);
        }
        assert!((clock.time_s(500, 60.0) - 60.0).abs() < 1e-12);
        assert!((clock.time_s(501, 60.001) - 60.001).abs() < 1e-12);
    }
}
