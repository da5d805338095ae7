//! Products of residuals and derivatives.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::evidence::linearisation::LinearTrial;

/// What a linear session says of all unknowns together, beyond the priors: products of residuals and derivatives.
#[derive(Debug, Clone)]
pub struct Products {
    pub(super) trials: Vec<TrialProducts>,
    squares: f64,
    count: usize,
}

#[derive(Debug, Clone)]
pub(super) struct TrialProducts {
    pub(super) own: DMatrix<f64>,
    pub(super) mixed: DMatrix<f64>,
    pub(super) common: DMatrix<f64>,
    pub(super) own_residual: DVector<f64>,
    pub(super) common_residual: DVector<f64>,
}

impl Products {
    /// The products of `trials`.
    pub fn new(trials: &[LinearTrial]) -> Self {
        let products = |trial: &LinearTrial| {
            // Products of whole matrices are several times faster than `tr_mul`, which goes from column to column.
            let (own, common) = (trial.own.transpose(), trial.common.transpose());
            TrialProducts {
                own: &own * &trial.own,
                mixed: &own * &trial.common,
                common: &common * &trial.common,
                own_residual: own * &trial.residual,
                common_residual: common * &trial.residual,
            }
        };
        Self {
            trials: trials.iter().map(products).collect(),
            squares: trials.iter().map(|trial| trial.residual.norm_squared()).sum(),
            count: trials.iter().map(|trial| trial.residual.len()).sum(),
        }
    }

    /// The same with one more common coordinate, of which the whitened predictions change by `change`.
    pub fn with_column(&self, trials: &[LinearTrial], change: &[DVector<f64>]) -> Self {
        let mut with = self.clone();
        for ((own, trial), column) in with.trials.iter_mut().zip(trials).zip(change) {
            let place = own.common_residual.len();
            let mixed = trial.own.tr_mul(column);
            let common = trial.common.tr_mul(column);
            let grown = |matrix: &DMatrix<f64>, rows: usize| matrix.clone().resize(rows, place + 1, 0.0);
            own.mixed = grown(&own.mixed, own.mixed.nrows());
            own.mixed.set_column(place, &mixed);
            own.common = grown(&own.common, place + 1);
            own.common.view_mut((0, place), (place, 1)).copy_from(&common);
            own.common.view_mut((place, 0), (1, place)).copy_from(&common.transpose());
            own.common[(place, place)] = column.norm_squared();
            own.common_residual = own.common_residual.push(column.dot(&trial.residual));
        }
        with
    }

    /// The same of a session whose residuals are `residuals`.
    pub fn with_residuals(mut self, trials: &[LinearTrial], residuals: &[DVector<f64>]) -> Self {
        for ((own, trial), residual) in self.trials.iter_mut().zip(trials).zip(residuals) {
            own.own_residual = trial.own.tr_mul(residual);
            own.common_residual = trial.common.tr_mul(residual);
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
