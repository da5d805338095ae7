//! Determinants, by which normal densities are scaled.

use nalgebra::DMatrix;

/// Logarithm of the determinant of a positive definite matrix from its lower triangular factor L (the matrix is L Lᵀ).
pub fn log_determinant_of_factor(lower: &DMatrix<f64>) -> f64 {
    2.0 * lower.diagonal().iter().map(|own| libm::log(*own)).sum::<f64>()
}
