//! The states that a mechanism adds to the model, now and at past times.

use crate::number::Number;
use crate::wrist::history::History;

/// The added states of one mechanism: state 0 is its first.
pub struct OwnStates<'a, T> {
    values: &'a [T],
    history: &'a History<T>,
    first: usize,
}

impl<'a, T: Number> OwnStates<'a, T> {
    /// The states `first..first + values.len()` of all added states, whose past is in `history`.
    #[inline(always)]
    pub(in crate::wrist) fn new(values: &'a [T], history: &'a History<T>, first: usize) -> Self {
        Self { values, history, first }
    }

    /// State number `state` at the present time.
    #[inline(always)]
    pub fn now(&self, state: usize) -> T {
        self.values[state]
    }

    /// State number `state` at `time_s - delay`; zero before the simulation starts.
    #[inline(always)]
    pub fn delayed(&self, state: usize, time_s: f64, delay: T) -> T {
        self.history.at(self.first + state, time_s, delay)
    }
}
