//! The added states at past samples, for mechanisms that act after a delay.

use super::interpolation::hermite;
use crate::number::{Lanes, Number};

/// The added states and their rates at every sample since the simulation started.
pub struct History<T> {
    start_s: f64,
    period_s: f64,
    /// Number of added states.
    states: usize,
    /// Sample by sample: the states, then their rates.
    values: Vec<T>,
}

impl<T: Number> History<T> {
    /// An empty history of `states` states. All states are zero before `start_s`; samples follow every `period_s`.
    pub fn new(start_s: f64, period_s: f64, states: usize) -> Self {
        Self { start_s, period_s, states, values: Vec::new() }
    }

    /// The same with room for `samples` samples.
    pub fn with_room(mut self, samples: usize) -> Self {
        self.values.reserve_exact(2 * self.states * samples);
        self
    }

    /// Adds the next sample: the added states and their rates.
    ///
    /// # Panics
    /// If `added` or `rates` has fewer values than the history has states.
    pub fn push(&mut self, added: &[T], rates: &[T]) {
        self.values.extend_from_slice(&added[..self.states]);
        self.values.extend_from_slice(&rates[..self.states]);
    }

    /// State number `state` and its rate at sample number `sample`.
    #[inline(always)]
    fn sample(&self, sample: usize, state: usize) -> (T, T) {
        let first = 2 * self.states * sample + state;
        (self.values[first], self.values[first + self.states])
    }

    /// State number `state` at `time_s - delay`, by cubic Hermite interpolation; zero before the start. A time after the last
    /// sample is extrapolated along the tangent there; that happens only for delays shorter than a sample.
    #[inline(always)]
    pub fn at(&self, state: usize, time_s: f64, delay: T) -> T {
        let zero = T::constant(0.0);
        if self.values.is_empty() {
            return zero;
        }
        let samples = self.values.len() / (2 * self.states);
        let lanes = T::Plain::LANES;
        let delays = delay.plain();
        // A delay that all trials share leads to the same past sample in all lanes.
        let mut is_shared = true;
        let mut lane = 1;
        while lane < lanes {
            is_shared &= delays.lane(lane) == delays.lane(0);
            lane += 1;
        }
        // Otherwise value and slope are computed lane by lane.
        let mut result = zero;
        let mut lane = 0;
        while lane < lanes {
            let elapsed = time_s - delays.lane(lane) - self.start_s;
            if elapsed >= 0.0 {
                let index = ((elapsed / self.period_s) as usize).min(samples - 1);
                let value = self.interpolated(state, time_s, delay, index, samples);
                if is_shared {
                    return value;
                }
                let mut mask = [0.0; 16];
                mask[lane] = 1.0;
                result = result + value.times(T::Plain::load(&mask));
            } else if is_shared {
                return zero;
            }
            lane += 1;
        }
        result
    }

    /// State number `state` at `time_s - delay`, which lies between sample `index` and the next.
    #[inline(always)]
    fn interpolated(&self, state: usize, time_s: f64, delay: T, index: usize, samples: usize) -> T {
        let fraction = T::constant((time_s - self.start_s) / self.period_s - index as f64)
            - delay.scale(1.0 / self.period_s);
        let (from, from_rate) = self.sample(index, state);
        if index + 1 == samples {
            return from + from_rate.scale(self.period_s) * fraction;
        }
        let (to, to_rate) = self.sample(index + 1, state);
        hermite(fraction, from, to, from_rate.scale(self.period_s), to_rate.scale(self.period_s))
    }
}
