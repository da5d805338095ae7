//! A number with its first derivatives (forward-mode automatic differentiation): the model's sensitivities are exact and need
//! no formulas written by hand.

use std::ops::{Add, Div, Mul, Neg, Sub};

use super::traits::{Number, Plain};

/// A value and its derivatives with respect to `N` variables.
///
/// ```
/// use ramphold::number::{Jet, Number};
/// let x = Jet::<f64, 1>::variable(0.5, 0);
/// assert_eq!((x * x).slope, [1.0]);
/// ```
#[derive(Debug, Clone, Copy)]
pub struct Jet<P, const N: usize> {
    /// The value.
    pub value: P,
    /// Its derivatives with respect to the variables.
    pub slope: [P; N],
}

// Loops instead of iterator adaptors or `array::from_fn`: the compiler builds a closure without the vector instructions of
// the surrounding function, and then calls it instead of inlining it.
macro_rules! each_slope {
    ($n:expr, |$i:ident| $slope:expr) => {{
        let mut slope = [P::splat(0.0); N];
        let mut $i = 0;
        while $i < $n {
            slope[$i] = $slope;
            $i += 1;
        }
        slope
    }};
}

impl<P: Plain, const N: usize> Number for Jet<P, N> {
    type Plain = P;

    #[inline(always)]
    fn lift(value: P) -> Self {
        Self { value, slope: [P::splat(0.0); N] }
    }

    #[inline(always)]
    fn variable(value: P, index: usize) -> Self {
        let mut slope = [P::splat(0.0); N];
        if index < N {
            slope[index] = P::splat(1.0);
        }
        Self { value, slope }
    }

    #[inline(always)]
    fn derivative(self, index: usize) -> P {
        if index < N { self.slope[index] } else { P::splat(0.0) }
    }

    #[inline(always)]
    fn plain(self) -> P {
        self.value
    }

    #[inline(always)]
    fn times(self, factor: P) -> Self {
        Self { value: self.value * factor, slope: each_slope!(N, |i| self.slope[i] * factor) }
    }

    #[inline(always)]
    fn add_scaled(self, other: Self, factor: f64) -> Self {
        let factor = P::splat(factor);
        Self {
            value: self.value + other.value * factor,
            slope: each_slope!(N, |i| other.slope[i].mul_add(factor, self.slope[i])),
        }
    }

    #[inline(always)]
    fn shifted(self, by: P) -> Self {
        Self { value: self.value + by, slope: self.slope }
    }

    #[inline(always)]
    fn with_slope(mut self, index: usize, slope: P) -> Self {
        if index < N {
            self.slope[index] = self.slope[index] + slope;
        }
        self
    }

    #[inline(always)]
    fn chain(self, value: P, slope: P) -> Self {
        Self { value, slope: each_slope!(N, |i| self.slope[i] * slope) }
    }
}

impl<P: Plain, const N: usize> Jet<P, N> {
    /// The same value with its first `M` derivatives; those beyond `N` are zero.
    #[inline(always)]
    pub fn with_derivatives<const M: usize>(self) -> Jet<P, M> {
        let mut result = Jet::<P, M>::lift(self.value);
        let mut i = 0;
        while i < M && i < N {
            result.slope[i] = self.slope[i];
            i += 1;
        }
        result
    }

    /// `self + a b`, fused, where `a` has the first `M` derivatives alone.
    #[inline(always)]
    pub fn plus_product<const M: usize>(self, a: Jet<P, M>, b: Self) -> Self {
        let mut sum = Self {
            value: a.value.mul_add(b.value, self.value),
            slope: each_slope!(N, |i| a.value.mul_add(b.slope[i], self.slope[i])),
        };
        let mut i = 0;
        while i < M {
            sum.slope[i] = a.slope[i].mul_add(b.value, sum.slope[i]);
            i += 1;
        }
        sum
    }

    /// `self + a factor`, fused, where `a` has the first `M` derivatives alone and the factor is a constant.
    #[inline(always)]
    pub fn plus_scaled<const M: usize>(mut self, a: Jet<P, M>, factor: P) -> Self {
        self.value = a.value.mul_add(factor, self.value);
        let mut i = 0;
        while i < M {
            self.slope[i] = a.slope[i].mul_add(factor, self.slope[i]);
            i += 1;
        }
        self
    }
}

impl<P: Plain, const N: usize> Add for Jet<P, N> {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { value: self.value + other.value, slope: each_slope!(N, |i| self.slope[i] + other.slope[i]) }
    }
}

impl<P: Plain, const N: usize> Sub for Jet<P, N> {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { value: self.value - other.value, slope: each_slope!(N, |i| self.slope[i] - other.slope[i]) }
    }
}

impl<P: Plain, const N: usize> Mul for Jet<P, N> {
    type Output = Self;
    #[inline(always)]
    fn mul(self, other: Self) -> Self {
        Self {
            value: self.value * other.value,
            slope: each_slope!(N, |i| self.slope[i].mul_add(other.value, self.value * other.slope[i])),
        }
    }
}

impl<P: Plain, const N: usize> Div for Jet<P, N> {
    type Output = Self;
    #[inline(always)]
    fn div(self, other: Self) -> Self {
        let value = self.value / other.value;
        Self { value, slope: each_slope!(N, |i| (self.slope[i] - value * other.slope[i]) / other.value) }
    }
}

impl<P: Plain, const N: usize> Neg for Jet<P, N> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self { value: -self.value, slope: each_slope!(N, |i| -self.slope[i]) }
    }
}
