//! Tail probabilities and quantiles, from the special functions of `statrs`.

use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::beta::beta_reg;
use statrs::function::gamma::checked_gamma_ur;

/// Half width of a 95 % interval of a normal distribution, in standard deviations.
pub const HALF_INTERVAL_95: f64 = 1.96;

/// Standard deviation of normal values in units of the median of their absolute values.
pub const SD_BY_MEDIAN: f64 = 1.4826;

/// P(F > f) with `df` degrees of freedom (numerator, denominator; fractions allowed). Precise to small relative error far out in the
/// tail; NaN if `f` is NaN or a degree of freedom is not positive.
pub fn f_tail(f: f64, df: [f64; 2]) -> f64 {
    if f.is_nan() || !df.iter().all(|df| *df > 0.0 && df.is_finite()) {
        return f64::NAN;
    }
    if f <= 0.0 {
        return 1.0;
    }
    // The upper tail itself, not one minus the lower tail, which would round small p-values to zero.
    beta_reg(df[1] / 2.0, df[0] / 2.0, df[1] / (df[0] * f + df[1]))
}

/// P(|T| > |t|) of Student's t with `df` degrees of freedom.
pub fn t_two_sided(t: f64, df: f64) -> f64 {
    f_tail(t * t, [1.0, df])
}

/// Quantile `p` of Student's t with `df` degrees of freedom; NaN unless 0 < p < 1.
pub fn t_quantile(p: f64, df: f64) -> f64 {
    match StudentsT::new(0.0, 1.0, df) {
        Ok(distribution) if p > 0.0 && p < 1.0 => distribution.inverse_cdf(p),
        _ => f64::NAN,
    }
}

/// P(chi-square > x) with `df` degrees of freedom.
pub fn chi_square_tail(x: f64, df: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    checked_gamma_ur(df / 2.0, x / 2.0).unwrap_or(f64::NAN)
}

/// 95 % confidence interval of a proportion, observed `found` times in `of` (Wilson 1927).
pub fn wilson(found: u32, of: u32) -> (f64, f64) {
    if of == 0 {
        return (0.0, 1.0);
    }
    const Z: f64 = 1.959_963_984_540_054;
    let (n, share) = (f64::from(of), f64::from(found) / f64::from(of));
    let middle = (share + Z * Z / (2.0 * n)) / (1.0 + Z * Z / n);
    let half = Z / (1.0 + Z * Z / n) * (share * (1.0 - share) / n + Z * Z / (4.0 * n * n)).sqrt();
    ((middle - half).max(0.0), (middle + half).min(1.0))
}
