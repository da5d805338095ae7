//! Weighted linear least squares with a few coefficients.

use nalgebra::{SMatrix, SVector};

/// Normal equations of a weighted linear regression with `P` coefficients: minimises sum of w (y - x'b)^2 + r b'b over b.
#[derive(Debug, Clone, PartialEq)]
pub struct WeightedRegression<const P: usize> {
    matrix: SMatrix<f64, P, P>,
    right: SVector<f64, P>,
}

impl<const P: usize> WeightedRegression<P> {
    /// No observations yet; `ridge` is r, the penalty on the squared coefficients (0 for none).
    pub fn new(ridge: f64) -> Self {
        Self { matrix: SMatrix::from_diagonal_element(ridge), right: SVector::zeros() }
    }

    /// Adds an observation `y` with regressors `x` and `weight` (the inverse of its variance, up to a factor common to all).
    pub fn add(&mut self, x: &SVector<f64, P>, weight: f64, y: f64) {
        self.matrix += weight * x * x.transpose();
        self.right += weight * y * x;
    }

    /// The coefficients; `None` if the regressors do not determine them.
    pub fn solve(&self) -> Option<SVector<f64, P>> {
        self.matrix.cholesky().map(|factor| factor.solve(&self.right))
    }

    /// Inverse of the normal matrix: the covariance of the coefficients if the weights are inverse variances. `None` if singular.
    pub fn inverse(&self) -> Option<SMatrix<f64, P, P>> {
        self.matrix.try_inverse()
    }
}

/// Slope b of the regression y = b x through the origin, from pairs (x, y); NaN if all x are zero.
pub fn slope_through_origin(pairs: impl IntoIterator<Item = (f64, f64)>) -> f64 {
    let (product, square) =
        pairs.into_iter().fold((0.0, 0.0), |(product, square), (x, y)| (product + x * y, square + x * x));
    product / square
}
