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
