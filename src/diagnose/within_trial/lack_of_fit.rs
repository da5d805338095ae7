//! Whether the residuals show any pattern at all, whatever its cause.
//!
//! The sum of squares alone cannot tell a wrong model from noise that is a little larger than the holds show. A wrong model
//! errs alike in trials that are alike, so the mean residual and its dependence on velocity and torque are looked at, each
//! against the scatter of the trials about it.

use nalgebra::{DMatrix, DVector};

use super::residual_projection::{Direction, Tangent};
use crate::fit::Observations;
use crate::statistics::group_indices;

/// How strongly the residuals go with one, velocity and torque, summed over independent values of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pattern {
    /// Sum of squared ratios of coefficient to standard error.
    pub statistic: f64,
    /// How many ratios there are: what the statistic is without any pattern.
    pub count: usize,
    /// The part of the sum of squares that goes with one, velocity and torque.
    pub squares: f64,
}

/// The pattern in whitened residuals. Trials of one noise share their axes; noises are treated one by one and added up.
pub fn pattern(prepared: &Observations, tangent: &Tangent, residuals: &Direction) -> Pattern {
    let mut result = Pattern { statistic: 0.0, count: 0, squares: 0.0 };
    let groups = group_indices(residuals.len(), |trial| prepared.noise_index[trial]);
    for trials in groups.values() {
        add(prepared, tangent, residuals, trials, &mut result);
    }
    result
}

fn add(
    prepared: &Observations,
    tangent: &Tangent,
    residuals: &Direction,
    trials: &[usize],
    result: &mut Pattern,
) {
    let regressors = regressors(prepared, trials);
    if trials.len() < 3 * regressors.ncols() {
        return;
    }
    let across = |value: usize| {
        DVector::from_iterator(trials.len(), trials.iter().map(|trial| residuals[*trial][value]))
    };
    for own in (0..tangent.torque_values(trials[0])).map(across) {
        let coefficients = regressors.tr_mul(&own);
        let left = &own - &regressors * &coefficients;
        let freedom = (trials.len() - regressors.ncols()) as f64;
        let variance = (left.norm_squared() / freedom).max(f64::MIN_POSITIVE);
        // A t value of few degrees of freedom has heavier tails than a normal one; squared and brought to the same mean.
        let expected = freedom / (freedom - 2.0).max(1.0);
        result.statistic += coefficients.norm_squared() / variance / expected;
        result.count += regressors.ncols();
        result.squares += coefficients.norm_squared();
    }
}

/// Orthonormal columns: one, velocity, torque, as far as they vary.
fn regressors(prepared: &Observations, trials: &[usize]) -> DMatrix<f64> {
    let columns: [&dyn Fn(usize) -> f64; 3] =
        [&|_| 1.0, &|trial| prepared.trials[trial].velocity_rad_s, &|trial| prepared.trials[trial].torque_nm];
    let mut kept: Vec<DVector<f64>> = Vec::new();
    for column in columns {
        let mut own = DVector::from_iterator(trials.len(), trials.iter().map(|trial| column(*trial)));
        let before = own.norm();
        for other in &kept {
            own -= other * other.dot(&own);
        }
        if own.norm() > 1e-6 * before {
            kept.push(own.normalize());
        }
    }
    DMatrix::from_columns(&kept)
}
