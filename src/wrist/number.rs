//! The number types that the model is written over.
//!
//! The model is written once, over [`Number`]. A [`Plain`] number is a value per trial: one (`f64`) or several at once
//! (the vectors of [`super::vector`]); a [`Jet`](super::jet::Jet) carries derivatives besides. All of them do the same
//! operations in the same order, without fused multiply-add, so a trial's result has the same bits whichever of them
//! computed it.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// What the equations of the model are written over.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The same number without its derivatives.
    type Plain: Plain;

    /// A constant: no derivatives.
    fn lift(value: Self::Plain) -> Self;

    /// Parameter number `index`; a number type without room for its derivative takes it as a constant.
    #[inline(always)]
    fn variable(value: Self::Plain, index: usize) -> Self {
        let _ = index;
        Self::lift(value)
    }

    /// The derivative with respect to parameter number `index`.
    #[inline(always)]
    fn derivative(self, index: usize) -> Self::Plain {
        let _ = index;
        Self::Plain::splat(0.0)
    }

    /// The value without derivatives.
    fn plain(self) -> Self::Plain;

    /// Product with a constant.
    fn times(self, factor: Self::Plain) -> Self;

    /// Sum with a constant.
    #[inline(always)]
    fn shifted(self, by: Self::Plain) -> Self {
        self + Self::lift(by)
    }

    /// The number with `slope` added to its derivative with respect to parameter number `index`, where there is room for it.
    #[inline(always)]
    fn with_slope(self, index: usize, slope: Self::Plain) -> Self {
        let _ = (index, slope);
        self
    }

    /// f(self), given the value and the slope of f there.
    fn chain(self, value: Self::Plain, slope: Self::Plain) -> Self;

    /// A constant, the same in every lane.
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::lift(Self::Plain::splat(value))
    }

    /// Product with a constant that is the same in every lane.
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self.times(Self::Plain::splat(factor))
    }

    /// e to the power of self.
    #[inline(always)]
    fn exp(self) -> Self {
        let value = super::elementary::exp(self.plain());
        self.chain(value, value)
    }

    /// log(1 + exp(self)), which cannot overflow; its slope is the logistic function.
    #[inline(always)]
    fn softplus(self) -> Self {
        let (value, slope) = super::elementary::softplus(self.plain());
        self.chain(value, slope)
    }

    /// The logistic function 1 / (1 + exp(-self)).
    #[inline(always)]
    fn logistic(self) -> Self {
        let (_, value) = super::elementary::softplus(self.plain());
        self.chain(value, value * (Self::Plain::splat(1.0) - value))
    }

    /// Hyperbolic tangent.
    #[inline(always)]
    fn tanh(self) -> Self {
        self.scale(2.0).logistic().scale(2.0) - Self::constant(1.0)
    }

    /// The number where it is positive, else zero.
    #[inline(always)]
    fn positive_part(self) -> Self {
        let x = self.plain();
        let zero = Self::Plain::splat(0.0);
        self.chain(x.max(zero), x.where_positive(Self::Plain::splat(1.0), zero))
    }
}

/// A number without derivatives: one value, or one a lane.
pub trait Plain: Number<Plain = Self> + Send + Sync {
    /// How many trials it holds.
    const LANES: usize;

    /// The same value in every lane.
    fn splat(value: f64) -> Self;

    /// One value a lane, from the start of `values`.
    fn load(values: &[f64]) -> Self;

    /// The value of one lane.
    fn lane(self, lane: usize) -> f64;

    /// The larger of the two, lane by lane.
    fn max(self, other: Self) -> Self;

    /// The smaller of the two, lane by lane.
    fn min(self, other: Self) -> Self;

    /// `yes` in the lanes where self > 0, else `no`.
    fn where_positive(self, yes: Self, no: Self) -> Self;

    /// self * 2^k, where `shifted` is k + 1.5 * 2^52 (so that its lowest bits are those of k).
    fn times_power_of_two(self, shifted: Self) -> Self;
}

impl Number for f64 {
    type Plain = f64;

    #[inline(always)]
    fn lift(value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn plain(self) -> f64 {
        self
    }

    #[inline(always)]
    fn times(self, factor: f64) -> f64 {
        self * factor
    }

    #[inline(always)]
    fn chain(self, value: f64, _slope: f64) -> f64 {
        value
    }
}

impl Plain for f64 {
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(value: f64) -> f64 {
        value
    }

    #[inline(always)]
    fn load(values: &[f64]) -> f64 {
        values[0]
    }

    #[inline(always)]
    fn lane(self, _lane: usize) -> f64 {
        self
    }

    // Both comparisons are those of the vector instructions: the second operand where either is NaN.
    #[inline(always)]
    fn max(self, other: f64) -> f64 {
        if self > other { self } else { other }
    }

    #[inline(always)]
    fn min(self, other: f64) -> f64 {
        if self < other { self } else { other }
    }

    #[inline(always)]
    fn where_positive(self, yes: f64, no: f64) -> f64 {
        if self > 0.0 { yes } else { no }
    }

    #[inline(always)]
    fn times_power_of_two(self, shifted: f64) -> f64 {
        f64::from_bits(self.to_bits().wrapping_add(shifted.to_bits() << 52))
    }
}
