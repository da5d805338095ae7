//! Factorisation and inversion of small symmetric positive definite matrices.

use nalgebra::{Cholesky, DMatrix, Dyn};

/// Cholesky factor of `matrix`; `None` if the matrix is not positive definite.
pub fn cholesky(matrix: DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    Cholesky::new(matrix)
}

/// Inverse of a positive definite matrix; `None` if the matrix is singular.
///
/// Rows and columns are scaled to a unit diagonal first, because the coordinates of a fit differ by orders of magnitude.
pub fn invert_scaled(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> =
        matrix.diagonal().iter().map(|x| 1.0 / libm::sqrt(x.max(f64::MIN_POSITIVE))).collect();
    let scaled =
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = cholesky(scaled)?.inverse();
    Some(DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}
