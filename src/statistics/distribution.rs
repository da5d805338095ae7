//! Tails and quantiles, from the special functions of `statrs`.

use statrs::distribution::{ContinuousCDF, StudentsT};
use statrs::function::beta::beta_reg;
use statrs::function::gamma::checked_gamma_ur;

/// P(F > f) with `df` degrees of freedom, which may be fractions. Keeps its relative precision far out in the tail.
pub fn f_tail(f: f64, df: [f64; 2]) -> f64 {
    if f.is_nan() || !df.iter().all(|df| *df > 0.0 && df.is_finite()) {
        return f64::NAN;
    }
    if f <= 0.0 {
        return 1.0;
    }
    // Not by one minus the other tail: small p-values would be lost in rounding.
    beta_reg(df[1] / 2.0, df[0] / 2.0, df[1] / (df[0] * f + df[1]))
}

/// P(|T| > |t|) with `df` degrees of freedom.
pub fn t_two_sided(t: f64, df: f64) -> f64 {
    f_tail(t * t, [1.0, df])
}

/// The t that a share `p` of the distribution lies below.
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

/// 95 % interval of a share that was `found` times in `of` (Wilson 1927).
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
