//! Cubic Hermite interpolation.

use crate::number::Number;

/// The cubic with the values `from` at u = 0 and `to` at u = 1 and the given slopes per unit of `u`, at `u`.
#[inline(always)]
pub fn hermite<T: Number>(u: T, from: T, to: T, from_slope: T, to_slope: T) -> T {
    let rise = to - from;
    let c2 = rise.scale(3.0) - from_slope.scale(2.0) - to_slope;
    let c3 = from_slope + to_slope - rise.scale(2.0);
    from + u * (from_slope + u * (c2 + u * c3))
}
