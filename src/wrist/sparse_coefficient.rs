//! What the equations multiply by, and what a product with it costs.
//!
//! Most coefficients of the base model do not depend on what is estimated, or on one parameter alone: a product with them
//! need not carry derivatives that are zero. The equations are written once over both kinds; values and derivatives have the
//! same bits either way.

use crate::number::{Number, Plain};

/// What a number can be multiplied by.
pub trait Coefficient<T: Number>: Copy {
    /// The product with `x`.
    fn of(self, x: T) -> T;

    /// `x` less the coefficient.
    fn off(self, x: T) -> T;
}

/// What the coefficients of a model may depend on.
pub trait DerivativeStructure<T: Number>: Copy {
    /// One that is a constant in the base model.
    type Constant: Coefficient<T>;
    /// One that depends on parameter number `INDEX` alone in the base model.
    type SingleParameter<const INDEX: usize>: Coefficient<T>;

    /// Takes what `value` may depend on.
    fn constant(value: T) -> Self::Constant;

    /// Takes what `value` may depend on.
    fn sole<const INDEX: usize>(value: T) -> Self::SingleParameter<INDEX>;
}

/// Every coefficient may depend on every parameter: what mechanisms leave of the base model.
#[derive(Debug, Clone, Copy)]
pub struct Dense;

/// The base model, each of whose parameters is where its derivative is.
#[derive(Debug, Clone, Copy)]
pub struct Sparse;

impl<T: Number> DerivativeStructure<T> for Dense {
    type Constant = DenseCoefficient<T>;
    type SingleParameter<const INDEX: usize> = DenseCoefficient<T>;

    #[inline(always)]
    fn constant(value: T) -> DenseCoefficient<T> {
        DenseCoefficient(value)
    }

    #[inline(always)]
    fn sole<const INDEX: usize>(value: T) -> DenseCoefficient<T> {
        DenseCoefficient(value)
    }
}

impl<T: Number> DerivativeStructure<T> for Sparse {
    type Constant = ConstantCoefficient<T::Plain>;
    type SingleParameter<const INDEX: usize> = SingleParameter<T::Plain, INDEX>;

    #[inline(always)]
    fn constant(value: T) -> ConstantCoefficient<T::Plain> {
        ConstantCoefficient(value.plain())
    }

    #[inline(always)]
    fn sole<const INDEX: usize>(value: T) -> SingleParameter<T::Plain, INDEX> {
        SingleParameter { value: value.plain(), slope: value.derivative(INDEX) }
    }
}

/// A number with all its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct DenseCoefficient<T>(T);

impl<T: Number> Coefficient<T> for DenseCoefficient<T> {
    #[inline(always)]
    fn of(self, x: T) -> T {
        self.0 * x
    }

    #[inline(always)]
    fn off(self, x: T) -> T {
        x - self.0
    }
}

/// A constant.
#[derive(Debug, Clone, Copy)]
pub struct ConstantCoefficient<P>(P);

impl<P: Plain, T: Number<Plain = P>> Coefficient<T> for ConstantCoefficient<P> {
    #[inline(always)]
    fn of(self, x: T) -> T {
        x.times(self.0)
    }

    #[inline(always)]
    fn off(self, x: T) -> T {
        x.shifted(-self.0)
    }
}

/// A number that depends on parameter number `INDEX` alone.
#[derive(Debug, Clone, Copy)]
pub struct SingleParameter<P, const INDEX: usize> {
    value: P,
    slope: P,
}

impl<P: Plain, T: Number<Plain = P>, const INDEX: usize> Coefficient<T> for SingleParameter<P, INDEX> {
    #[inline(always)]
    fn of(self, x: T) -> T {
        x.times(self.value).with_slope(INDEX, x.plain() * self.slope)
    }

    #[inline(always)]
    fn off(self, x: T) -> T {
        x.shifted(-self.value).with_slope(INDEX, -self.slope)
    }
}
