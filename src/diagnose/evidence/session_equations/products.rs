//! Products of residuals and derivatives.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::evidence::linearisation::LinearTrial;

/// What a linear session says of all unknowns together, beyond the priors: products of residuals and derivatives.
#[derive(Debug, Clone)]
pub struct Products {
    pub(super) trials: Vec<TrialProducts>,
    /// Those of the common coordinates, over all trials.
    pub(super) common: DMatrix<f64>,
    pub(super) common_residual: DVector<f64>,
    squares: f64,
    count: usize,
}

#[derive(Debug, Clone)]
pub(super) struct TrialProducts {
    pub(super) own: DMatrix<f64>,
    pub(super) mixed: DMatrix<f64>,
    pub(super) own_residual: DVector<f64>,
}

impl Products {
    /// The products of `trials`.
    pub fn new(trials: &[LinearTrial]) -> Self {
        let count = trials.first().map_or(0, |trial| trial.common.ncols());
        let (mut common, mut common_residual) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let products = |trial: &LinearTrial| {
            // One product of whole matrices is several times faster than several of narrow ones.
            let size = trial.own.ncols();
            let mut columns = DMatrix::zeros(trial.residual.len(), size + count + 1);
            columns.columns_mut(0, size).copy_from(&trial.own);
            columns.columns_mut(size, count).copy_from(&trial.common);
            columns.column_mut(size + count).copy_from(&trial.residual);
            let product = columns.transpose() * &columns;
            common += product.view((size, size), (count, count));
            common_residual += product.view((size, size + count), (count, 1));
            TrialProducts {
                own: product.view((0, 0), (size, size)).into_owned(),
                mixed: product.view((0, size), (size, count)).into_owned(),
                own_residual: product.view((0, size + count), (size, 1)).column(0).into_owned(),
            }
        };
        Self {
            trials: trials.iter().map(products).collect(),
            common,
            common_residual,
            squares: trials.iter().map(|trial| trial.residual.norm_squared()).sum(),
            count: trials.iter().map(|trial| trial.residual.len()).sum(),
        }
    }

    /// The same of a session whose residuals are `residuals`.
    pub fn with_residuals(mut self, trials: &[LinearTrial], residuals: &[DVector<f64>]) -> Self {
        self.common_residual.fill(0.0);
        for ((own, trial), residual) in self.trials.iter_mut().zip(trials).zip(residuals) {
            own.own_residual = trial.own.tr_mul(residual);
            self.common_residual.gemv_tr(1.0, &trial.common, residual, 1.0);
        }
        self.squares = residuals.iter().map(DVector::norm_squared).sum();
        self
    }

    /// Sum of squares of the residuals.
    pub fn squares(&self) -> f64 {
        self.squares
    }

    /// Number of residuals.
    pub fn count(&self) -> usize {
        self.count
    }
}
