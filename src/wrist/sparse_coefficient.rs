//! Coefficients of the equations whose derivatives are known to be zero, so that a product need not compute them.
//!
//! Most coefficients of the base model are constants or depend on one parameter alone. The equations are written once, over
//! [`DerivativeStructure`]; values and derivatives have the same bits with either structure.

use crate::number::{Number, Plain};

/// A factor in the equations, with some or all of its derivatives.
pub trait Coefficient<T: Number>: Copy {
    /// The product of the coefficient and `x`.
    fn multiply(self, x: T) -> T;

    /// `x` minus the coefficient.
    fn subtract_from(self, x: T) -> T;
}

/// Which derivatives of the coefficients of a model may differ from zero.
pub trait DerivativeStructure<T: Number>: Copy {
    /// A coefficient that is a constant in the base model.
    type Constant: Coefficient<T>;
    /// A coefficient that depends on parameter number `INDEX` alone in the base model.
    type SingleParameter<const INDEX: usize>: Coefficient<T>;

    /// Drops the derivatives of a constant that are structurally zero.
    fn constant(value: T) -> Self::Constant;

    /// Drops the derivatives that are structurally zero, of a value that depends on parameter number `INDEX` alone.
    fn single_parameter<const INDEX: usize>(value: T) -> Self::SingleParameter<INDEX>;
}

/// Every coefficient may depend on every parameter: models with mechanisms.
#[derive(Debug, Clone, Copy)]
pub struct Dense;

/// Every coefficient depends on one parameter at most, and derivative number i belongs to parameter number i: the base model.
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
    fn single_parameter<const INDEX: usize>(value: T) -> DenseCoefficient<T> {
        DenseCoefficient(value)
    }
}

impl<T: Number> DerivativeStructure<T> for Sparse {
    type Constant = ConstantCoefficient<T::Plain>;
    type SingleParameter<const INDEX: usize> = SingleParameterCoefficient<T::Plain, INDEX>;

    #[inline(always)]
    fn constant(value: T) -> ConstantCoefficient<T::Plain> {
        ConstantCoefficient(value.plain())
    }

    #[inline(always)]
    fn single_parameter<const INDEX: usize>(value: T) -> SingleParameterCoefficient<T::Plain, INDEX> {
        SingleParameterCoefficient { value: value.plain(), slope: value.derivative(INDEX) }
    }
}

/// A coefficient with all its derivatives.
#[derive(Debug, Clone, Copy)]
pub struct DenseCoefficient<T>(T);

impl<T: Number> Coefficient<T> for DenseCoefficient<T> {
    #[inline(always)]
    fn multiply(self, x: T) -> T {
        self.0 * x
    }

    #[inline(always)]
    fn subtract_from(self, x: T) -> T {
        x - self.0
    }
}

/// A coefficient without derivatives.
#[derive(Debug, Clone, Copy)]
pub struct ConstantCoefficient<P>(P);

impl<P: Plain, T: Number<Plain = P>> Coefficient<T> for ConstantCoefficient<P> {
    #[inline(always)]
    fn multiply(self, x: T) -> T {
        x.times(self.0)
    }

    #[inline(always)]
    fn subtract_from(self, x: T) -> T {
        x.shifted(-self.0)
    }
}

/// A coefficient with one derivative, number `INDEX`.
#[derive(Debug, Clone, Copy)]
pub struct SingleParameterCoefficient<P, const INDEX: usize> {
    value: P,
    slope: P,
}

impl<P: Plain, T: Number<Plain = P>, const INDEX: usize> Coefficient<T>
    for SingleParameterCoefficient<P, INDEX>
{
    #[inline(always)]
    fn multiply(self, x: T) -> T {
        x.times(self.value).with_slope(INDEX, x.plain() * self.slope)
    }

    #[inline(always)]
    fn subtract_from(self, x: T) -> T {
        x.shifted(-self.value).with_slope(INDEX, -self.slope)
    }
}
