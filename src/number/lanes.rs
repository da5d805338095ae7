//! The arithmetic that scalars and vectors of scalars share.
//!
//! A [`Lanes`] value holds one `f64` per lane: a single one (`f64`) or several at once (the vectors of the sibling file). Every operation
//! is done lane by lane in IEEE double precision, and a multiplication is fused with an addition only where the code says so
//! ([`Lanes::mul_add`]). So a trial's result has the same bits in a scalar and in any lane of a vector.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// One value per lane, with the operations that the elementary functions need.
pub trait Lanes:
    Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Neg<Output = Self>
{
    /// Number of lanes: how many trials one value holds.
    const LANES: usize;

    /// The given value in every lane.
    fn splat(value: f64) -> Self;

    /// One value per lane, taken from the start of `values`.
    ///
    /// # Panics
    /// If `values` is shorter than [`Lanes::LANES`].
    fn load(values: &[f64]) -> Self;

    /// The value in lane number `lane`, from 0.
    fn lane(self, lane: usize) -> f64;

    /// The larger of `self` and `other`, lane by lane; `other` where either is NaN.
    fn max(self, other: Self) -> Self;

    /// The smaller of `self` and `other`, lane by lane; `other` where either is NaN.
    fn min(self, other: Self) -> Self;

    /// `self factor + addend` with one rounding, lane by lane. A processor without the instruction computes the same bits slowly.
    fn mul_add(self, factor: Self, addend: Self) -> Self;

    /// Whether any lane is above 0.
    fn any_positive(self) -> bool;

    /// `yes` in the lanes where `self` is above 0, `no` in the others.
    fn where_positive(self, yes: Self, no: Self) -> Self;

    /// `self` times 2^k, where `shifted` is k + 1.5 * 2^52, so that its lowest bits are those of k.
    fn times_power_of_two(self, shifted: Self) -> Self;
}

impl Lanes for f64 {
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

    #[inline(always)]
    fn mul_add(self, factor: f64, addend: f64) -> f64 {
        f64::mul_add(self, factor, addend)
    }

    #[inline(always)]
    fn any_positive(self) -> bool {
        self > 0.0
    }

    // Written as the vector instructions compare: the second operand where either is NaN.
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
