//! The posterior's precision matrix over all unknowns of a session, as its Cholesky factor.
//!
//! It is an arrowhead in an arrowhead. A trial's own coordinates depend on the mean of their condition and on the common coordinates; a
//! condition's mean on these and on the coefficients of the regression. So trials are eliminated first, each by itself, then the means,
//! and what is left is the border: the common coordinates, then the coefficients.

use nalgebra::{DMatrix, DVector};

use super::block_columns::{BlockColumns, column_mut, dot, subtract};
use super::design::{Design, REGRESSORS};
use super::products::Products;
use super::spreads::Spreads;

/// A value for each unknown.
#[derive(Debug, Clone)]
pub(super) struct ArrowheadVector {
    /// Those of each trial: own coordinates by trials.
    pub own: DMatrix<f64>,
    /// Mean of each condition: own coordinates by conditions.
    pub means: DMatrix<f64>,
    /// Common coordinates, then coefficients.
    pub border: DVector<f64>,
}

impl ArrowheadVector {
    /// The scalar product with another one.
    pub fn dot(&self, other: &Self) -> f64 {
        self.own.dot(&other.own) + self.means.dot(&other.means) + self.border.dot(&other.border)
    }
}

/// The Cholesky factor of the precision matrix.
#[derive(Debug, Clone)]
pub struct ArrowheadFactor {
    /// Columns of the trials' own coordinates. Rows below: mean of the condition, common coordinates.
    pub(super) trials: BlockColumns,
    /// Columns of the conditions' means. Rows below: common coordinates, coefficients.
    pub(super) means: BlockColumns,
    border: BlockColumns,
}

impl ArrowheadFactor {
    /// The factor for `design` with `spreads` and a session of these `products`; `None` if the matrix is not positive definite.
    ///
    /// `damping` is added to the diagonal for the own coordinates; for the common ones, that many times the precision of their prior.
    pub(super) fn new(design: &Design, spreads: &Spreads, products: &Products, damping: f64) -> Option<Self> {
        let trials = trial_columns(design, spreads, products, damping)?;
        let means = mean_columns(design, spreads, &trials)?;
        let (size, common) = (design.own, design.common_mean.len());
        let mut border = design.border_precision(spreads);
        (0..common).for_each(|place| border[(place, place)] *= 1.0 + damping);
        add_regression(&mut border, design, spreads);
        let mut of_common = border.view_mut((0, 0), (common, common));
        of_common += &products.common / spreads.noise;
        let below = trials.columns().rows(2 * size, common);
        of_common.gemm(-1.0, &below, &below.transpose(), 1.0);
        let below = means.columns().rows(size, border.nrows());
        border.gemm(-1.0, &below, &below.transpose(), 1.0);
        Some(Self { trials, means, border: BlockColumns::of_matrix(border)? })
    }

    /// Logarithm of the determinant of the precision matrix.
    pub(super) fn log_determinant(&self) -> f64 {
        2.0 * (self.trials.log_diagonal() + self.means.log_diagonal() + self.border.log_diagonal())
    }

    /// Covariance of the border's unknowns.
    pub(super) fn border_covariance(&self) -> DMatrix<f64> {
        let inverse = self.border.divided();
        inverse.columns().transpose() * inverse.columns()
    }

    /// Multiplies `values` by the inverse of the factor.
    pub(super) fn solve_forward(&self, design: &Design, values: &mut ArrowheadVector) {
        let (size, border) = (design.own, values.border.as_mut_slice());
        for (condition, trials) in design.conditions.iter().enumerate() {
            let mean = column_mut(&mut values.means, condition);
            for trial in trials {
                let own = column_mut(&mut values.own, *trial);
                self.trials.solve_forward(*trial, own);
                for (k, value) in own.iter().enumerate() {
                    let below = self.trials.below(*trial, k);
                    subtract(mean, *value, below);
                    subtract(border, *value, &below[size..]);
                }
            }
            self.means.solve_forward(condition, mean);
            for (k, value) in mean.iter().enumerate() {
                subtract(border, *value, self.means.below(condition, k));
            }
        }
        self.border.solve_forward(0, border);
    }

    /// Multiplies `values` by the inverse of the transposed factor.
    pub(super) fn solve_backward(&self, design: &Design, values: &mut ArrowheadVector) {
        self.border.solve_backward(0, values.border.as_mut_slice());
        let (size, border) = (design.own, values.border.as_slice());
        for (condition, trials) in design.conditions.iter().enumerate() {
            let mean = column_mut(&mut values.means, condition);
            for (k, value) in mean.iter_mut().enumerate() {
                *value -= dot(border, self.means.below(condition, k));
            }
            self.means.solve_backward(condition, mean);
            for trial in trials {
                let own = column_mut(&mut values.own, *trial);
                for (k, value) in own.iter_mut().enumerate() {
                    let below = self.trials.below(*trial, k);
                    *value -= dot(mean, below) + dot(border, &below[size..]);
                }
                self.trials.solve_backward(*trial, own);
            }
        }
    }
}

/// The factor's columns of the trials.
fn trial_columns(
    design: &Design,
    spreads: &Spreads,
    products: &Products,
    damping: f64,
) -> Option<BlockColumns> {
    let (size, common) = (design.own, design.common_mean.len());
    let scaled = |values: &mut [f64], data: &[f64]| {
        values.iter_mut().zip(data).for_each(|(value, data)| *value = data / spreads.noise);
    };
    let mut columns = BlockColumns::zeros(size, size + common, design.variance_factor.len());
    for trial in design.conditions.iter().flatten() {
        for k in 0..size {
            let (own, with_common) = products.of_trial(*trial, k);
            let column = columns.column_mut(*trial, k);
            scaled(&mut column[..size], own);
            scaled(&mut column[2 * size..], with_common);
            let weight = design.trial_precision(spreads, *trial, k);
            column[k] += weight + damping;
            column[size + k] = -weight;
        }
        columns.factor(*trial)?;
    }
    Some(columns)
}

/// The factor's columns of the means, where the trials are eliminated.
fn mean_columns(design: &Design, spreads: &Spreads, trials: &BlockColumns) -> Option<BlockColumns> {
    let (size, common) = (design.own, design.common_mean.len());
    let mut columns = BlockColumns::zeros(size, common + REGRESSORS * size, design.conditions.len());
    for (condition, members) in design.conditions.iter().enumerate() {
        for k in 0..size {
            let column = columns.column_mut(condition, k);
            let weight = 1.0 / spreads.condition[k];
            let of_trials = members.iter().map(|trial| design.trial_precision(spreads, *trial, k));
            column[k] = weight + of_trials.sum::<f64>();
            for (a, regressor) in design.regressors[condition].iter().enumerate() {
                column[size + common + a * size + k] = -weight * regressor;
            }
            for trial in members {
                for own in 0..size {
                    let below = &trials.below(*trial, own)[k..];
                    subtract(&mut column[k..], below[0], below);
                }
            }
        }
        columns.factor(condition)?;
    }
    Some(columns)
}

/// Adds the precision that means of conditions, if they were known, would give the coefficients of the regression.
fn add_regression(border: &mut DMatrix<f64>, design: &Design, spreads: &Spreads) {
    let (size, first) = (design.own, design.common_mean.len());
    for a in 0..REGRESSORS {
        for b in 0..REGRESSORS {
            let sum: f64 = design.regressors.iter().map(|own| own[a] * own[b]).sum();
            for k in 0..size {
                border[(first + a * size + k, first + b * size + k)] += sum / spreads.condition[k];
            }
        }
    }
}
