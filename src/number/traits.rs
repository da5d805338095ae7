//! The number types that the model and the filters are written over.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::elementary;
use super::lanes::Lanes;

/// A number with the operations that the equations of the model and the filters use, with or without derivatives.
pub trait Number:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// The type of the value without its derivatives.
    type Plain: Plain;

    /// A constant: all its derivatives are zero.
    fn lift(value: Self::Plain) -> Self;

    /// An independent variable: its derivative number `index` is 1, the others are 0. A type that has no derivative of this
    /// index makes a constant.
    #[inline(always)]
    fn variable(value: Self::Plain, index: usize) -> Self {
        let _ = index;
        Self::lift(value)
    }

    /// Derivative number `index`; 0 if the type has none of this index.
    #[inline(always)]
    fn derivative(self, index: usize) -> Self::Plain {
        let _ = index;
        Self::Plain::splat(0.0)
    }

    /// The value without derivatives.
    fn plain(self) -> Self::Plain;

    /// Product with a constant, lane by lane.
    fn times(self, factor: Self::Plain) -> Self;

    /// Sum with a constant, lane by lane.
    #[inline(always)]
    fn shifted(self, by: Self::Plain) -> Self {
        self + Self::lift(by)
    }

    /// The number with `slope` added to derivative number `index`, if the type has one of this index.
    #[inline(always)]
    fn with_slope(self, index: usize, slope: Self::Plain) -> Self {
        let _ = (index, slope);
        self
    }

    /// f(self) by the chain rule, given the value of f and its derivative at `self`.
    fn chain(self, value: Self::Plain, slope: Self::Plain) -> Self;

    /// A constant with the given value in every lane.
    #[inline(always)]
    fn constant(value: f64) -> Self {
        Self::lift(Self::Plain::splat(value))
    }

    /// Product with a constant that has the given value in every lane.
    #[inline(always)]
    fn scale(self, factor: f64) -> Self {
        self.times(Self::Plain::splat(factor))
    }

    /// Sum with `other` times a constant that has the given value in every lane. Derivatives are multiplied and added with one rounding;
    /// the value has the same bits as that of the single operations.
    #[inline(always)]
    fn add_scaled(self, other: Self, factor: f64) -> Self {
        self + other.scale(factor)
    }

    /// e to the power of self.
    #[inline(always)]
    fn exp(self) -> Self {
        let value = self.plain().exponential();
        self.chain(value, value)
    }

    /// log(1 + exp(self)), without overflow; its derivative is the logistic function.
    #[inline(always)]
    fn softplus(self) -> Self {
        let (value, slope) = self.plain().softplus_and_slope();
        self.chain(value, slope)
    }

    /// The logistic function 1 / (1 + exp(-self)).
    #[inline(always)]
    fn logistic(self) -> Self {
        let (_, value) = self.plain().softplus_and_slope();
        self.chain(value, value * (Self::Plain::splat(1.0) - value))
    }

    /// Hyperbolic tangent.
    #[inline(always)]
    fn tanh(self) -> Self {
        self.scale(2.0).logistic().scale(2.0) - Self::constant(1.0)
    }

    /// The number where it is positive, zero elsewhere.
    #[inline(always)]
    fn positive_part(self) -> Self {
        let x = self.plain();
        let zero = Self::Plain::splat(0.0);
        self.chain(x.max(zero), x.where_positive(Self::Plain::splat(1.0), zero))
    }
}

/// A number without derivatives: one value per lane.
pub trait Plain: Lanes + Number<Plain = Self> + Send + Sync {
    /// e to the power of self.
    #[inline(always)]
    fn exponential(self) -> Self {
        elementary::exp(self)
    }

    /// log(1 + exp(self)), without overflow, and its slope, the logistic function.
    #[inline(always)]
    fn softplus_and_slope(self) -> (Self, Self) {
        elementary::softplus(self)
    }
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

impl Plain for f64 {}
