//! A quantity at the ends of the last steps, and the polynomials through them.

use super::linear_response::FORCE;
use crate::number::Number;

/// A quantity at the end of the last step and its backward differences: through it go the polynomials of Adams's methods (Hairer, Nørsett
/// and Wanner 1993, Solving ordinary differential equations I, section III.1). Before the first step it is zero.
#[derive(Debug, Clone, Copy)]
pub(super) struct PastValues<T> {
    pub now: T,
    first: T,
    second: T,
}

impl<T: Number> PastValues<T> {
    /// Zero at all times.
    #[inline(always)]
    pub fn zero() -> Self {
        let zero = T::constant(0.0);
        Self { now: zero, first: zero, second: zero }
    }

    /// Forgets how the value came about: it is taken to have been the same before.
    #[inline(always)]
    pub fn settle(&mut self) {
        *self = Self { now: self.now, ..Self::zero() };
    }

    /// Over the next step, as a polynomial in its fraction: the parabola through the last three values.
    #[inline(always)]
    pub fn ahead(&self) -> [T; FORCE] {
        let half = self.second.scale(0.5);
        [self.now, self.first + half, half, T::constant(0.0)]
    }

    /// The same, where the value at the end of the next step is `next`: the cubic through it and the last three values.
    #[inline(always)]
    pub fn until(&self, next: T) -> [T; FORCE] {
        let first = next - self.now;
        let second = first - self.first;
        let sixth = (second - self.second).scale(1.0 / 6.0);
        let half = second.scale(0.5);
        [self.now, first - half - sixth, half, sixth]
    }

    /// Goes on to the end of the next step, where the value is `next`.
    #[inline(always)]
    pub fn push(&mut self, next: T) {
        let first = next - self.now;
        *self = Self { now: next, first, second: first - self.first };
    }
}

/// The mean of a polynomial over the step.
#[inline(always)]
pub(super) fn mean<T: Number>(polynomial: &[T; FORCE]) -> T {
    let [a, b, c, d] = *polynomial;
    a.add_scaled(b, 0.5).add_scaled(c, 1.0 / 3.0).add_scaled(d, 0.25)
}
