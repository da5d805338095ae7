//! One more common unknown.

use nalgebra::DVector;

use super::arrowhead::ArrowheadVector;
use super::design::Design;
use super::products::ResidualProducts;
use super::quadratic::Quadratic;
use crate::diagnose::evidence::linearisation::LinearTrial;

/// One more common unknown, about zero.
#[derive(Debug, Clone, Copy)]
pub struct AddedColumn {
    /// What it adds to the logarithm of the evidence.
    pub log_evidence: f64,
    /// Its most probable value.
    pub value: f64,
}

impl Quadratic {
    /// What one more common unknown adds, of a normal prior about zero with standard deviation `sd`, by which the whitened predictions of
    /// `trials` change by `change`. The quadratic is that of `design` and `trials` with the variance `noise`.
    pub fn with_column(
        &self,
        design: &Design,
        trials: &[LinearTrial],
        noise: f64,
        change: &[DVector<f64>],
        sd: f64,
    ) -> AddedColumn {
        // With the other unknowns, the column has the products that residuals have.
        let products = ResidualProducts::new(trials, change);
        let mut mixed = ArrowheadVector {
            own: &products.own / noise,
            means: &self.solved_gradient.means * 0.0,
            border: &self.solved_gradient.border * 0.0,
        };
        mixed.border.rows_mut(0, products.common.len()).axpy(1.0 / noise, &products.common, 0.0);
        self.factor.solve_forward(design, &mut mixed);
        let with_residuals: f64 =
            trials.iter().zip(change).map(|(trial, column)| column.dot(&trial.residual)).sum();
        let precision = 1.0 / (sd * sd) + products.squares / noise - mixed.dot(&mixed);
        let gradient = -with_residuals / noise - mixed.dot(&self.solved_gradient);
        AddedColumn {
            log_evidence: 0.5 * gradient * gradient / precision - 0.5 * libm::log(precision * sd * sd),
            value: -gradient / precision,
        }
    }
}
