//! A smooth function of one argument: a cubic spline with eight coefficients.

use crate::number::{Lanes, Number};

/// Number of coefficients of a [`Spline`].
pub const SPLINE_COEFFICIENTS: usize = 8;

/// Length of the parameter vector of a [`Spline`]: both ends of its range, then the coefficients.
pub const SPLINE_PARAMETERS: usize = 2 + SPLINE_COEFFICIENTS;

/// Number of intervals between the knots within the range.
const INTERVALS: f64 = 5.0;

/// The function h(u) = sum over k of c_k B_k(u), with cubic B-splines B_k on uniform knots over a range of u.
///
/// Beyond the range, h keeps its value at the end of the range. The ends are constants: h has no derivatives by them.
#[derive(Debug, Clone, Copy)]
pub struct Spline<'a, T: Number> {
    from: T::Plain,
    knots_per_unit: T::Plain,
    coefficients: &'a [T],
}

impl<'a, T: Number> Spline<'a, T> {
    /// The spline with these parameters: lower and upper end of the range, then the coefficients.
    #[inline(always)]
    pub fn new(parameters: &'a [T]) -> Self {
        let (from, to) = (parameters[0].plain(), parameters[1].plain());
        let knots_per_unit = T::Plain::splat(INTERVALS) / (to - from);
        Self { from, knots_per_unit, coefficients: &parameters[2..SPLINE_PARAMETERS] }
    }

    /// h(u) - h(rest).
    #[inline(always)]
    pub fn change(&self, u: T, rest: T) -> T {
        let (at, from) = (u.plain(), rest.plain());
        let mut change = u.chain(T::Plain::splat(0.0), self.slope(at))
            - rest.chain(T::Plain::splat(0.0), self.slope(from));
        let (at, from) = (self.basis(at, 0), self.basis(from, 0));
        let mut k = 0;
        while k < SPLINE_COEFFICIENTS {
            change = change + self.coefficients[k].times(at[k] - from[k]);
            k += 1;
        }
        change
    }

    /// The slope h'(u).
    #[inline(always)]
    pub fn slope_at(&self, u: T) -> T {
        let (slopes, curvatures) = (self.basis(u.plain(), 1), self.basis(u.plain(), 2));
        let mut curvature = T::Plain::splat(0.0);
        let mut slope = T::constant(0.0);
        let mut k = 0;
        while k < SPLINE_COEFFICIENTS {
            curvature = curvature + self.coefficients[k].plain() * curvatures[k];
            slope = slope + self.coefficients[k].times(slopes[k]);
            k += 1;
        }
        slope + u.chain(T::Plain::splat(0.0), curvature)
    }

    /// h'(u) without its derivatives.
    #[inline(always)]
    fn slope(&self, u: T::Plain) -> T::Plain {
        let slopes = self.basis(u, 1);
        let mut slope = T::Plain::splat(0.0);
        let mut k = 0;
        while k < SPLINE_COEFFICIENTS {
            slope = slope + self.coefficients[k].plain() * slopes[k];
            k += 1;
        }
        slope
    }

    /// The B-splines at `u`, or their derivatives of the given `order` (up to 2) by u.
    #[inline(always)]
    fn basis(&self, u: T::Plain, order: usize) -> [T::Plain; SPLINE_COEFFICIENTS] {
        let (zero, last) = (T::Plain::splat(0.0), T::Plain::splat(INTERVALS));
        let place = (u - self.from) * self.knots_per_unit;
        let within = place.max(zero).min(last);
        // The derivatives by u; they are zero beyond the range.
        let mut factor = T::Plain::splat(1.0);
        if order > 0 {
            let inside = place.where_positive((last - place).where_positive(factor, zero), zero);
            factor = if order == 1 { self.knots_per_unit } else { self.knots_per_unit * self.knots_per_unit };
            factor = factor * inside;
        }
        let mut basis = [zero; SPLINE_COEFFICIENTS];
        let mut k = 0;
        while k < SPLINE_COEFFICIENTS {
            let from_centre = within - T::Plain::splat(k as f64 - 1.0);
            basis[k] = cardinal(from_centre, order) * factor;
            k += 1;
        }
        basis
    }
}

/// The cubic B-spline with knots at the integers from -2 to 2, or its derivative of the given `order` (up to 2): a sum of
/// truncated powers of the distance from its ends and from the knots next to its centre.
#[inline(always)]
fn cardinal<P: Lanes>(t: P, order: usize) -> P {
    let zero = P::splat(0.0);
    let distance = t.max(-t);
    let outer = (P::splat(2.0) - distance).max(zero);
    let inner = (P::splat(1.0) - distance).max(zero);
    match order {
        0 => outer * outer * outer * P::splat(1.0 / 6.0) - inner * inner * inner * P::splat(4.0 / 6.0),
        1 => {
            let falling = outer * outer * P::splat(0.5) - inner * inner * P::splat(2.0);
            t.where_positive(-falling, falling)
        }
        _ => outer - inner * P::splat(4.0),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with(coefficients: [f64; SPLINE_COEFFICIENTS]) -> Vec<f64> {
        [-0.3, 1.7].into_iter().chain(coefficients).collect()
    }

    #[test]
    fn the_b_splines_sum_to_one_within_the_range_and_beyond() {
        let parameters = with([0.0; SPLINE_COEFFICIENTS]);
        let spline = Spline::new(&parameters);
        for step in 0..=100 {
            let u = -0.8 + 0.03 * f64::from(step);
            let sum: f64 = spline.basis(u, 0).iter().sum();
            assert!((sum - 1.0).abs() < 1e-14, "{u}: {sum}");
            for order in [1, 2] {
                let sum: f64 = spline.basis(u, order).iter().sum();
                assert!(sum.abs() < 1e-12, "{u}: derivative {order} sums to {sum}");
            }
        }
    }

    #[test]
    fn coefficients_on_a_straight_line_give_a_straight_line() {
        // The coefficient number k belongs to the knot number k - 1.
        let parameters = with(std::array::from_fn(|k| -0.3 + 0.4 * (k as f64 - 1.0)));
        let spline = Spline::new(&parameters);
        for u in [-0.3, -0.11, 0.2, 0.9, 1.69] {
            assert!((spline.change(u, 0.0) - u).abs() < 1e-14, "{u}");
        }
        assert!((spline.slope_at(0.5) - 1.0).abs() < 1e-13);
    }

    #[test]
    fn slope_and_curvature_are_those_of_the_value() {
        let parameters = with([0.3, -0.2, 0.5, 0.1, -0.7, 0.9, 0.2, -0.4]);
        let spline = Spline::new(&parameters);
        let step = 1e-5;
        for u in [-0.25, 0.0, 0.33, 1.2, 1.65] {
            let slope = spline.change(u + step, u - step) / (2.0 * step);
            assert!((spline.slope_at(u) - slope).abs() < 1e-8, "{u}: {slope}");
            let jet = crate::number::Jet::<f64, 1>::variable(u, 0);
            let lifted: Vec<_> = parameters.iter().map(|p| crate::number::Jet::lift(*p)).collect();
            let curvature = (spline.slope_at(u + step) - spline.slope_at(u - step)) / (2.0 * step);
            let own = Spline::new(&lifted).slope_at(jet).slope[0];
            assert!((own - curvature).abs() < 1e-7, "{u}: {own} and {curvature}");
        }
    }
}
