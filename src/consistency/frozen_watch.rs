//! Whether a channel of EMG goes on changing while it is recorded.

use super::frozen_emg::{SHORTEST_RUN_S, longest_run_by_chance};

/// Before so much of a channel is known, s, it does not say how often two samples in a row are equal, and no shorter run counts.
const LEARNED_S: f64 = 1.0;

/// What becomes of a channel of EMG.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum EmgChange {
    /// It has kept a value for longer than is tolerated, and than noise and resolution can explain.
    Frozen {
        /// The value, in the unit of the channel.
        value: f64,
        /// For how long, s.
        for_s: f64,
    },
    /// It changes again.
    Live {
        /// After how long, s.
        after_s: f64,
    },
}

/// Watches a channel of EMG, sample by sample. How long a run of equal values may be follows from the channel as it was before the run, as in
/// [`check_frozen`](super::check_frozen).
#[derive(Debug, Clone)]
pub struct FrozenWatch {
    rate_hz: f64,
    /// Runs of equal values up to this long are not reported, s.
    tolerated_s: f64,
    last: Option<f64>,
    /// Pairs of equal neighbours in the run under way.
    run: usize,
    /// Pairs of neighbours before that run, without those of the runs that were told; and how many of them were equal.
    pairs: usize,
    equal: usize,
    is_frozen: bool,
}

impl FrozenWatch {
    /// Watches a channel with `rate_hz` samples a second. A run of equal values of up to `tolerated_s` is let pass.
    pub fn new(rate_hz: f64, tolerated_s: f64) -> Self {
        Self { rate_hz, tolerated_s, last: None, run: 0, pairs: 0, equal: 0, is_frozen: false }
    }

    /// Takes the next sample, and says if the channel stands still from now on, or goes on again.
    pub fn take(&mut self, value: f64) -> Option<EmgChange> {
        let last = self.last.replace(value)?;
        // NaN says that there is no value.
        if value == last || (value.is_nan() && last.is_nan()) {
            self.run += 1;
            let for_s = self.run as f64 / self.rate_hz;
            if !self.is_frozen && for_s > self.longest_s() {
                self.is_frozen = true;
                return Some(EmgChange::Frozen { value, for_s });
            }
            return None;
        }
        let run = std::mem::take(&mut self.run);
        self.pairs += 1;
        if std::mem::take(&mut self.is_frozen) {
            return Some(EmgChange::Live { after_s: run as f64 / self.rate_hz });
        }
        self.pairs += run;
        self.equal += run;
        None
    }

    /// The stream of the channel was interrupted: the next sample is no neighbour of the last.
    pub fn interrupt(&mut self) {
        let Self { rate_hz, tolerated_s, pairs, equal, .. } = *self;
        *self = Self { pairs, equal, ..Self::new(rate_hz, tolerated_s) };
    }

    fn longest_s(&self) -> f64 {
        let is_known = self.pairs as f64 >= LEARNED_S * self.rate_hz;
        let least_s = if is_known { SHORTEST_RUN_S } else { LEARNED_S };
        let equal = (self.equal + 1) as f64 / (self.pairs + 2) as f64;
        let by_chance = longest_run_by_chance(equal, self.pairs + self.run + 1);
        self.tolerated_s.max(least_s).max(by_chance / self.rate_hz)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    const RATE_HZ: f64 = 2000.0;

    /// Noise with a standard deviation of `steps` steps of the converter.
    fn noise(steps: f64, samples: usize) -> Vec<f64> {
        let mut stream = Stream::new(3, "frozen watch");
        (0..samples).map(|_| libm::round(steps * stream.normal())).collect()
    }

    /// The changes that are reported of a channel with these values, each with its sample.
    fn told(values: &[f64], tolerated_s: f64) -> Vec<(usize, EmgChange)> {
        let mut watch = FrozenWatch::new(RATE_HZ, tolerated_s);
        values.iter().enumerate().filter_map(|(at, value)| Some((at, watch.take(*value)?))).collect()
    }

    #[test]
    fn a_channel_that_stops_is_told_after_the_tolerated_time_and_once_and_so_is_its_return() {
        let mut values = noise(20.0, 20_000);
        values[8000..13_000].fill(300.0);
        let [(stopped, frozen), (back, live)] = told(&values, 0.5)[..] else {
            panic!("{:?}", told(&values, 0.5))
        };
        assert_eq!(stopped, 9001);
        assert_eq!(frozen, EmgChange::Frozen { value: 300.0, for_s: 0.5005 });
        assert_eq!((back, live), (13_000, EmgChange::Live { after_s: 4999.0 / RATE_HZ }));
    }

    #[test]
    fn noise_of_any_resolution_is_live() {
        for steps in [0.2, 0.3, 0.5, 1.0, 10.0, 1000.0] {
            assert_eq!(told(&noise(steps, 1_000_000), 0.1), [], "{steps} steps");
        }
    }

    #[test]
    fn a_channel_that_never_changed_is_told_after_a_second() {
        let told = told(&[0.0; 4000], 0.1);
        assert_eq!(told, [(2001, EmgChange::Frozen { value: 0.0, for_s: 1.0005 })]);
    }

    #[test]
    fn a_silence_between_two_equal_samples_is_no_run() {
        let mut watch = FrozenWatch::new(RATE_HZ, 0.1);
        noise(20.0, 2000).into_iter().for_each(|value| assert_eq!(watch.take(value), None));
        for _ in 0..20 {
            (0..150).for_each(|_| assert_eq!(watch.take(7.0), None));
            watch.interrupt();
        }
    }
}
