//! Lack-of-fit test: whether the residuals have any systematic pattern, whatever its cause.
//!
//! The sum of squares alone cannot tell a wrong model from noise that is a little larger than the holds show. A wrong model
//! makes similar errors in similar trials, so the mean residual and its dependence on velocity and torque are tested against the
//! scatter of the trials about them.

use nalgebra::{DMatrix, DVector};

use super::residual_projection::{ResidualProjection, WhitenedTrials};
use crate::fit::Observations;
use crate::statistics::group_indices;

/// Regression of the residuals on a constant, velocity and torque, summed over the whitened values of the window.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pattern {
    /// Sum of squared ratios of coefficients to standard errors.
    pub statistic: f64,
    /// Number of ratios: the expected value of `statistic` without a pattern.
    pub count: usize,
    /// Sum of squares explained by the regression.
    pub squares: f64,
}

/// Computes the pattern in whitened residuals. Trials with the same noise covariance share their whitened axes; each such group is
/// analysed on its own and added up.
pub fn pattern(
    observations: &Observations,
    tangent: &ResidualProjection,
    residuals: &WhitenedTrials,
) -> Pattern {
    let mut result = Pattern { statistic: 0.0, count: 0, squares: 0.0 };
    let groups = group_indices(residuals.len(), |trial| observations.noise_index[trial]);
    for trials in groups.values() {
        add(observations, tangent, residuals, trials, &mut result);
    }
    result
}

fn add(
    observations: &Observations,
    tangent: &ResidualProjection,
    residuals: &WhitenedTrials,
    trials: &[usize],
    result: &mut Pattern,
) {
    let regressors = regressors(observations, trials);
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
        // The expected value of a squared t value with few degrees of freedom exceeds 1.
        let expected = freedom / (freedom - 2.0).max(1.0);
        result.statistic += coefficients.norm_squared() / variance / expected;
        result.count += regressors.ncols();
        result.squares += coefficients.norm_squared();
    }
}

/// Orthonormal regressors: a constant, velocity and torque, as far as they vary.
fn regressors(observations: &Observations, trials: &[usize]) -> DMatrix<f64> {
    let columns: [&dyn Fn(usize) -> f64; 3] =
        [&|_| 1.0, &|trial| observations.trials[trial].velocity_rad_s, &|trial| {
            observations.trials[trial].torque_nm
        }];
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
