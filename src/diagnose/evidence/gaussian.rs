//! Integrals and determinants of normal distributions.

use nalgebra::DMatrix;
use statrs::function::erf::erfc;

use crate::statistics::log_determinant_of_factor;

/// Logarithm of the standard normal distribution function at `x`.
pub fn log_normal_distribution(x: f64) -> f64 {
    if x > -6.0 {
        libm::log(0.5 * erfc(-x / std::f64::consts::SQRT_2))
    } else {
        // The first terms of the asymptotic series.
        -0.5 * x * x - libm::log(-x) - 0.5 * libm::log(std::f64::consts::TAU)
            + libm::log1p(-1.0 / (x * x) + 3.0 / libm::pow(x, 4.0))
    }
}

/// A smooth covariance of the coefficients of a spline, for a variance of one: its inverse, and the logarithm of that one's
/// determinant.
pub fn smooth_precision(size: usize, knots: f64) -> (DMatrix<f64>, f64) {
    /// Part of the variance that is not smooth, which keeps the matrix well conditioned.
    const ROUGH: f64 = 1e-3;
    let covariance = DMatrix::from_fn(size, size, |i, j| {
        let distance = (i as f64 - j as f64) / knots;
        libm::exp(-0.5 * distance * distance) + if i == j { ROUGH } else { 0.0 }
    });
    let log_covariance = log_determinant(covariance.clone()).unwrap_or(0.0);
    let precision = covariance.cholesky().map_or_else(|| DMatrix::identity(size, size), |own| own.inverse());
    (precision, -log_covariance)
}

/// Logarithm of the determinant of a positive definite matrix; `None` if it is not.
pub fn log_determinant(matrix: DMatrix<f64>) -> Option<f64> {
    if matrix.nrows() == 0 {
        return Some(0.0);
    }
    matrix.cholesky().map(|factor| log_determinant_of_factor(factor.l_dirty()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_logarithm_of_the_normal_distribution_is_smooth_where_its_form_changes() {
        for (x, expected) in [
            (0.0, -std::f64::consts::LN_2),
            (-2.0, -3.783_184_303_0),
            (-5.999, -20.730_6),
            (-6.001, -20.742_9),
            (-40.0, -804.608_44),
        ] {
            assert!(
                (log_normal_distribution(x) - expected).abs() < 2e-3,
                "{x}: {}",
                log_normal_distribution(x)
            );
        }
    }

    #[test]
    fn a_determinant_is_that_of_the_eigenvalues() {
        let matrix = DMatrix::from_row_slice(2, 2, &[2.0, 0.5, 0.5, 1.0]);
        assert!((log_determinant(matrix).unwrap() - libm::log(1.75)).abs() < 1e-12);
        assert_eq!(log_determinant(DMatrix::from_row_slice(1, 1, &[-1.0])), None);
        assert_eq!(log_determinant(DMatrix::zeros(0, 0)), Some(0.0));
    }
}
