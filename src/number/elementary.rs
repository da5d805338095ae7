//! exp and log(1 + exp) without branches, table or library call, so that every lane of a vector does what a scalar does.
//!
//! `libm` serves wherever one value is needed; here the same code must run in all lanes at once. The errors against
//! `libm` are tested below: a few units in the last place.

use super::lanes::Lanes;

/// 1/n! for the Taylor series of exp on |r| <= log(2)/2, whose remainder after r^12 is below 2e-16.
const INVERSE_FACTORIALS: [f64; 13] = [
    1.0,
    1.0,
    0.5,
    1.0 / 6.0,
    1.0 / 24.0,
    1.0 / 120.0,
    1.0 / 720.0,
    1.0 / 5_040.0,
    1.0 / 40_320.0,
    1.0 / 362_880.0,
    1.0 / 3_628_800.0,
    1.0 / 39_916_800.0,
    1.0 / 479_001_600.0,
];

/// 1/(2n + 1) for the series of artanh(s)/s in s^2, s <= 1/3, whose remainder after s^30 is below 2e-17.
const INVERSE_ODDS: [f64; 16] = [
    1.0,
    1.0 / 3.0,
    1.0 / 5.0,
    1.0 / 7.0,
    1.0 / 9.0,
    1.0 / 11.0,
    1.0 / 13.0,
    1.0 / 15.0,
    1.0 / 17.0,
    1.0 / 19.0,
    1.0 / 21.0,
    1.0 / 23.0,
    1.0 / 25.0,
    1.0 / 27.0,
    1.0 / 29.0,
    1.0 / 31.0,
];

/// The polynomial with these coefficients, lowest first, summed by pairs (Estrin 1960): Horner's rule makes every step wait
/// for the one before, and the model waits for its yield.
#[inline(always)]
fn polynomial<P: Lanes, const N: usize>(coefficients: &[f64; N], x: P) -> P {
    let mut terms = [P::splat(0.0); N];
    let mut term = 0;
    while term < N {
        terms[term] = P::splat(coefficients[term]);
        term += 1;
    }
    let (mut count, mut power) = (N, x);
    while count > 1 {
        let mut pair = 0;
        while 2 * pair + 1 < count {
            terms[pair] = terms[2 * pair] + terms[2 * pair + 1] * power;
            pair += 1;
        }
        if count % 2 == 1 {
            terms[pair] = terms[count - 1];
        }
        count = count.div_ceil(2);
        power = power * power;
    }
    terms[0]
}

/// 2^52 + 2^51: adding and subtracting it rounds to the nearest integer.
const ROUNDER: f64 = 6_755_399_441_055_744.0;

/// log(2) in two parts, the first with so few bits that a multiple of it is exact.
const LN_2: [f64; 2] = [6.931_471_803_691_238e-1, 1.908_214_929_270_587_7e-10];

/// e^x; x is held within +-708, where the result is a normal number.
#[inline(always)]
pub(super) fn exp<P: Lanes>(x: P) -> P {
    let x = x.min(P::splat(708.0)).max(P::splat(-708.0));
    let shifted = x * P::splat(std::f64::consts::LOG2_E) + P::splat(ROUNDER);
    let power = shifted - P::splat(ROUNDER);
    let r = x - power * P::splat(LN_2[0]) - power * P::splat(LN_2[1]);
    polynomial(&INVERSE_FACTORIALS, r).times_power_of_two(shifted)
}

/// log(1 + e^x) and its slope, the logistic function of x.
#[inline(always)]
pub(super) fn softplus<P: Lanes>(x: P) -> (P, P) {
    let one = P::splat(1.0);
    let e = exp(x.min(-x)); // e^-|x|, in (0, 1]
    // log(1 + e) = 2 artanh(s) with s = e / (2 + e) <= 1/3
    let s = e / (P::splat(2.0) + e);
    let series = polynomial(&INVERSE_ODDS, s * s);
    let inverse = one / (one + e);
    let value = x.max(P::splat(0.0)) + (s + s) * series;
    (value, x.where_positive(inverse, e * inverse))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exp_agrees_with_libm() {
        for step in -70_000..70_000 {
            let x = step as f64 * 0.01;
            let relative = exp(x) / libm::exp(x) - 1.0;
            assert!(relative.abs() < 4e-15, "exp({x}): {relative:e}");
        }
    }

    #[test]
    fn softplus_agrees_with_libm_and_never_overflows() {
        for step in -8_000..8_000 {
            let x = step as f64 * 0.1 + 0.0123;
            let (value, slope) = softplus(x);
            let expected = if x > 30.0 { x + libm::exp(-x) } else { libm::log1p(libm::exp(x)) };
            assert!((value / expected - 1.0).abs() < 1e-14 || x < -700.0, "softplus({x}) = {value:e}");
            let logistic =
                if x > 0.0 { 1.0 / (1.0 + libm::exp(-x)) } else { libm::exp(x) / (1.0 + libm::exp(x)) };
            assert!((slope / logistic - 1.0).abs() < 1e-14 || x < -700.0, "logistic({x}) = {slope:e}");
        }
    }
}
