//! The objective function: the sum of squared residuals, whitened by the covariance of the residuals if one is known.

use nalgebra::{DMatrix, DVector};

use super::residual_covariance::{residual_covariances, whitening_matrices};
use crate::fit::data::observations::{NoiseSource, Observations};
use crate::signal::NoiseCovariance;

/// Weighting of the residuals that a user asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Weighted by the inverse covariance of the residuals, which is estimated from the holds; unweighted if there are no holds.
    #[default]
    MeasuredNoise,
    /// Ordinary least squares, as in the paper (section 2.4).
    Plain,
}

/// The objective function of a fit.
#[derive(Debug, Clone)]
pub enum Objective {
    /// Half the sum of squared torque residuals, (N m)^2 (section 2.4 of the paper).
    LeastSquares,
    /// Half the sum of squares of whitened residuals, without unit. There is one whitening matrix per noise covariance of the
    /// session; its columns are the values of a trial.
    Whitened(Vec<DMatrix<f64>>),
}

impl Objective {
    /// The objective for `weighting`, and the covariances of the residuals if they can be estimated. `point` are rough values of the
    /// base parameters, for the propagation of the angle error.
    ///
    /// Only noise from holds weights residuals: differences between repetitions contain more than noise.
    pub fn new(
        observations: &Observations,
        weighting: Weighting,
        point: Option<&[f64; 6]>,
    ) -> (Self, Vec<NoiseCovariance>) {
        let (Some(point), Some(source)) = (point, observations.noise_source) else {
            return (Self::LeastSquares, Vec::new());
        };
        match (source, weighting) {
            (NoiseSource::Repetitions, _) => (Self::LeastSquares, observations.noise_covariances.clone()),
            (_, Weighting::Plain) => (Self::LeastSquares, residual_covariances(observations, point)),
            (_, Weighting::MeasuredNoise) => {
                let covariances = residual_covariances(observations, point);
                (Self::Whitened(whitening_matrices(observations, &covariances)), covariances)
            }
        }
    }

    /// The whitening matrix of a trial with this noise index; `None` if its residuals are not weighted.
    pub fn whitening_matrix(&self, noise_index: Option<usize>) -> Option<&DMatrix<f64>> {
        match self {
            Self::LeastSquares => None,
            Self::Whitened(matrices) => noise_index.map(|noise| &matrices[noise]),
        }
    }

    /// Whitens the values of a trial, N m: multiplies by the whitening matrix, if there is one.
    pub fn whiten(&self, noise_index: Option<usize>, torque_nm: &[f64]) -> DVector<f64> {
        let torque = DVector::from_column_slice(torque_nm);
        match self.whitening_matrix(noise_index) {
            Some(matrix) => matrix * torque,
            None => torque,
        }
    }

    /// Whitens each column of `columns`, whose rows are the values of a trial.
    pub fn whiten_columns(&self, noise_index: Option<usize>, columns: &DMatrix<f64>) -> DMatrix<f64> {
        match self.whitening_matrix(noise_index) {
            Some(matrix) => matrix * columns,
            None => columns.clone(),
        }
    }

    /// Number of whitened values of a trial of `rows` values.
    pub fn whitened_count(&self, noise_index: Option<usize>, rows: usize) -> usize {
        self.whitening_matrix(noise_index).map_or(rows, DMatrix::nrows)
    }
}
