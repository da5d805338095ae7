//! The added states at history samples, for mechanisms that act after a delay.

use crate::number::{Lanes, Number};
use crate::wrist::plant::MEMORY;

/// The added states and their rates, one entry a sample from the start of the trial.
pub struct History<T> {
    start_s: f64,
    period_s: f64,
    entries: Vec<[[T; MEMORY]; 2]>,
}

impl<T: Number> History<T> {
    /// Nothing has happened before `start_s`; entries follow every `period_s`.
    pub fn new(start_s: f64, period_s: f64) -> Self {
        Self { start_s, period_s, entries: Vec::new() }
    }

    /// Adds the states at the next sample, and their rates.
    pub fn push(&mut self, states_and_rates: [[T; MEMORY]; 2]) {
        self.entries.push(states_and_rates);
    }

    /// State `slot` at `time_s - delay`, by cubic Hermite interpolation; zero before the start. A moment after the last
    /// entry is read off the last entry's tangent, which only happens for delays shorter than a sample.
    #[inline(always)]
    pub fn read(&self, slot: usize, time_s: f64, delay: T) -> T {
        let zero = T::constant(0.0);
        if self.entries.is_empty() {
            return zero;
        }
        // Each lane has its own delay, so its own place in the history: (value, slope in time) is gathered lane by lane.
        let mut result = zero;
        let lanes = T::Plain::LANES;
        for lane in 0..lanes {
            let elapsed = time_s - delay.plain().lane(lane) - self.start_s;
            if elapsed < 0.0 {
                continue;
            }
            let index = (elapsed / self.period_s) as usize;
            let index = index.min(self.entries.len() - 1);
            let fraction = T::constant((time_s - self.start_s) / self.period_s - index as f64)
                - delay.scale(1.0 / self.period_s);
            let (from, from_rate) = (self.entries[index][0][slot], self.entries[index][1][slot]);
            let value = match self.entries.get(index + 1) {
                None => from + from_rate.scale(self.period_s) * fraction,
                Some([to, to_rate]) => hermite(
                    fraction,
                    from,
                    to[slot],
                    from_rate.scale(self.period_s),
                    to_rate[slot].scale(self.period_s),
                ),
            };
            if lanes == 1 {
                return value;
            }
            let mut mask = [0.0; 16];
            mask[lane] = 1.0;
            result = result + value.times(T::Plain::load(&mask));
        }
        result
    }
}

/// The cubic through two values with given slopes (per unit of `u`, which runs from 0 to 1).
#[inline(always)]
pub fn hermite<T: Number>(u: T, from: T, to: T, from_slope: T, to_slope: T) -> T {
    let rise = to - from;
    let c2 = rise.scale(3.0) - from_slope.scale(2.0) - to_slope;
    let c3 = from_slope + to_slope - rise.scale(2.0);
    from + u * (from_slope + u * (c2 + u * c3))
}
