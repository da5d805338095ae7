//! Factorisation and inversion of small symmetric positive definite matrices.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Cholesky factor of `matrix`; `None` if the matrix is not positive definite.
pub fn cholesky(matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    Cholesky::new(matrix)
}

/// Inverse of the matrix that has this factor. The inverse of the factor keeps its zeros, and one product of whole matrices follows, which
/// is several times faster than to solve for every column of the identity.
pub fn inverse_of(factor: &Cholesky<f64, Dyn>) -> DMatrix<f64> {
    let lower = factor.l_dirty();
    let count = lower.nrows();
    let mut inverse = DMatrix::zeros(count, count);
    for column in 0..count {
        let below = (count - column, count - column);
        let mut own = inverse.view_mut((column, column), (below.0, 1));
        own[0] = 1.0;
        lower.view((column, column), below).solve_lower_triangular_unchecked_mut(&mut own);
    }
    inverse.transpose() * inverse
}

/// Inverse of a positive definite matrix; `None` if the matrix is singular.
///
/// Rows and columns are scaled to a unit diagonal first, because the coordinates of a fit differ by orders of magnitude.
pub fn invert_scaled(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> =
        matrix.diagonal().iter().map(|x| 1.0 / libm::sqrt(x.max(f64::MIN_POSITIVE))).collect();
    let scaled =
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = inverse_of(&cholesky(scaled)?);
    Some(DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_inverse_of_a_factored_matrix_is_its_inverse() {
        let factor = DMatrix::from_fn(9, 9, |i, j| {
            if i < j { 0.0 } else { 1.0 / (1.0 + (i * j) as f64) + f64::from(u8::from(i == j)) }
        });
        let matrix = &factor * factor.transpose();
        let error = &matrix * inverse_of(&cholesky(matrix.clone()).unwrap()) - DMatrix::identity(9, 9);
        assert!(error.amax() < 1e-12, "{error}");
    }
}
