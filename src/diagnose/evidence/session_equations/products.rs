//! Products of residuals and derivatives.

use nalgebra::{DMatrix, DVector};

use super::block_columns::dot;
use super::design::Point;
use crate::diagnose::evidence::linearisation::LinearTrial;

/// What a linear session says of all unknowns together, beyond the priors: products of residuals and derivatives.
#[derive(Debug, Clone)]
pub struct Products {
    /// Those of derivatives by own coordinates, trial after trial: columns are own coordinates, rows own and then common coordinates.
    trials: DMatrix<f64>,
    /// Those of derivatives by common coordinates, over all trials.
    pub(super) common: DMatrix<f64>,
    /// Those of the residuals.
    pub(super) residuals: ResidualProducts,
}

/// Products of residuals with derivatives and with themselves.
#[derive(Debug, Clone)]
pub struct ResidualProducts {
    /// With derivatives by own coordinates: own coordinates by trials.
    pub(super) own: DMatrix<f64>,
    /// With derivatives by common coordinates, over all trials.
    pub(super) common: DVector<f64>,
    /// Sum of squares.
    pub(super) squares: f64,
    /// Number of residuals.
    pub(super) count: usize,
}

impl Products {
    /// The products of `trials`.
    pub fn new(trials: &[LinearTrial]) -> Self {
        let (size, count) = trials.first().map_or((0, 0), |trial| (trial.own.ncols(), trial.common.ncols()));
        let mut own = DMatrix::zeros(size + count, size * trials.len());
        let mut common = DMatrix::zeros(count, count);
        let mut residuals = ResidualProducts::zeros(size, trials.len(), count);
        for (number, trial) in trials.iter().enumerate() {
            // One product of whole matrices is several times faster than several of narrow ones.
            let mut columns = DMatrix::zeros(trial.residual.len(), size + count + 1);
            columns.columns_mut(0, size).copy_from(&trial.own);
            columns.columns_mut(size, count).copy_from(&trial.common);
            columns.column_mut(size + count).copy_from(&trial.residual);
            let product = columns.transpose() * &columns;
            own.columns_mut(size * number, size).copy_from(&product.view((0, 0), (size + count, size)));
            common += product.view((size, size), (count, count));
            residuals.own.column_mut(number).copy_from(&product.view((0, size + count), (size, 1)));
            residuals.common += product.view((size, size + count), (count, 1));
            residuals.squares += product[(size + count, size + count)];
            residuals.count += trial.residual.len();
        }
        Self { trials: own, common, residuals }
    }

    /// Those of own coordinate `k` of a trial: with its own coordinates, and with common coordinates.
    #[inline]
    pub(super) fn of_trial(&self, trial: usize, k: usize) -> (&[f64], &[f64]) {
        let (rows, size) = (self.trials.nrows(), self.residuals.own.nrows());
        self.trials.as_slice()[(size * trial + k) * rows..][..rows].split_at(size)
    }

    /// Sum of squares of the residuals after a step.
    pub(super) fn squares_after(&self, step: &Point) -> f64 {
        let ResidualProducts { own, common, squares, .. } = &self.residuals;
        let mut after =
            squares - 2.0 * common.dot(&step.common) + step.common.dot(&(&self.common * &step.common));
        for (trial, moved) in step.own.iter().enumerate() {
            for (k, by) in moved.iter().enumerate() {
                let (with_own, with_common) = self.of_trial(trial, k);
                let change = dot(with_own, moved.as_slice()) + 2.0 * dot(with_common, step.common.as_slice());
                after += by * (change - 2.0 * own[(k, trial)]);
            }
        }
        after
    }

    /// Sum of squares of the residuals.
    pub fn squares(&self) -> f64 {
        self.residuals.squares
    }

    /// Number of residuals.
    pub fn count(&self) -> usize {
        self.residuals.count
    }
}

impl ResidualProducts {
    /// The products of a session whose derivatives are those of `trials`, and whose residuals are `residuals`.
    pub fn new(trials: &[LinearTrial], residuals: &[DVector<f64>]) -> Self {
        let (size, common) = trials.first().map_or((0, 0), |trial| (trial.own.ncols(), trial.common.ncols()));
        let mut products = Self::zeros(size, trials.len(), common);
        for (number, (trial, residual)) in trials.iter().zip(residuals).enumerate() {
            products.own.column_mut(number).gemv_tr(1.0, &trial.own, residual, 0.0);
            products.common.gemv_tr(1.0, &trial.common, residual, 1.0);
            products.squares += residual.norm_squared();
            products.count += residual.len();
        }
        products
    }

    fn zeros(size: usize, trials: usize, common: usize) -> Self {
        Self { own: DMatrix::zeros(size, trials), common: DVector::zeros(common), squares: 0.0, count: 0 }
    }
}
