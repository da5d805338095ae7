//! Factors and inverses of covariances, which may be none: then nothing is returned, and no other matrix in their place.

use nalgebra::{DMatrix, DVector};

/// Largest part by which the variances of a covariance are raised until it has a factor: rounding needs far less, and what needs more is no
/// covariance.
const LARGEST_RIDGE: f64 = 1.0;

/// Lower factor of a covariance of products, of which some may nearly be sums of others: these count once. `None` if it is no covariance.
pub fn cholesky_factor(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut ridge = 1e-9;
    while ridge <= LARGEST_RIDGE {
        let mut raised = covariance.clone();
        for place in 0..raised.nrows() {
            raised[(place, place)] *= 1.0 + ridge;
        }
        match raised.cholesky().map(|factor| factor.l()) {
            Some(factor) => return factor.iter().all(|own| own.is_finite()).then_some(factor),
            None => ridge *= 10.0,
        }
    }
    None
}

/// Solves for the values that `factor`, one of [`cholesky_factor`], makes of independent ones.
pub fn solve_lower(factor: &DMatrix<f64>, vector: &DVector<f64>) -> DVector<f64> {
    factor.solve_lower_triangular(vector).expect("the diagonal of a Cholesky factor is positive")
}

/// The same for the columns of a matrix.
pub fn solve_lower_columns(factor: &DMatrix<f64>, matrix: &DMatrix<f64>) -> DMatrix<f64> {
    factor.solve_lower_triangular(matrix).expect("the diagonal of a Cholesky factor is positive")
}

/// Inverse of a positive definite matrix, whose rows may differ by orders of magnitude; `None` if it is none.
pub fn inverse(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let size = matrix.nrows();
    let scale = matrix.diagonal().map(|value| 1.0 / libm::sqrt(value));
    let unit = DMatrix::from_fn(size, size, |row, column| matrix[(row, column)] * scale[row] * scale[column]);
    let inverse = unit.cholesky()?.inverse();
    let scaled =
        DMatrix::from_fn(size, size, |row, column| inverse[(row, column)] * scale[row] * scale[column]);
    scaled.iter().all(|own| own.is_finite()).then_some(scaled)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_matrix_that_is_no_covariance_has_no_factor() {
        let factor = cholesky_factor(&DMatrix::from_row_slice(2, 2, &[4.0, 2.0, 2.0, 2.0])).unwrap();
        assert!((factor[(0, 0)] - 2.0).abs() < 1e-8 && (factor[(1, 1)] - 1.0).abs() < 1e-8, "{factor}");
        // One that is the sum of the other: rounding decides, and both count once.
        assert!(cholesky_factor(&DMatrix::from_element(2, 2, 1.0)).is_some());
        for value in [f64::NAN, f64::INFINITY, -1.0, 0.0] {
            assert_eq!(cholesky_factor(&DMatrix::from_diagonal_element(2, 2, value)), None, "{value}");
        }
        assert_eq!(cholesky_factor(&DMatrix::from_row_slice(2, 2, &[1.0, 3.0, 3.0, 1.0])), None);
    }

    #[test]
    fn only_a_positive_definite_matrix_has_an_inverse() {
        // Rows that differ by orders of magnitude.
        let found = inverse(DMatrix::from_row_slice(2, 2, &[2e12, 1e3, 1e3, 2e-6])).unwrap();
        assert!(
            (found[(0, 0)] * 1.5e12 - 1.0).abs() < 1e-9 && (found[(1, 1)] * 1.5e-6 - 1.0).abs() < 1e-9,
            "{found}"
        );
        for value in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
            assert_eq!(inverse(DMatrix::from_diagonal_element(2, 2, value)), None, "{value}");
        }
        assert_eq!(inverse(DMatrix::from_row_slice(2, 2, &[1.0, 2.0, 2.0, 1.0])), None);
    }
}
