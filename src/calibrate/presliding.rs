//! Whether the trials show a bearing that gives before it slides, and where its search starts.

use nalgebra::DVector;

use super::constants::{PRESLIDING_PLACE, PRESLIDING_TRAVEL_PLACE};
use super::fit::RigFitInput;
use super::linear_algebra::inverse;
use crate::statistics::chi_square_tail;

/// Coordinates of the travel at which it is looked for: over the range that engineering allows, each half a decade from the next.
const TRAVELS: [f64; 5] = [-1.0, -0.5, 0.0, 0.5, 1.0];

/// Probability of searching it in a bearing that has none: the search then costs time, and changes nothing beyond the standard errors.
const SEARCHED_LEVEL: f64 = 0.05;

/// A start of its search from a fit without it, at `point`, where the trials show it. `input` has its coordinates.
///
/// A score test: how far the part of such a friction would go from zero, by the slopes of all coordinates at the fit, at each travel. What
/// the fit leaves counts as noise, and the level is shared by the travels (Bonferroni).
pub fn presliding_start(input: &RigFitInput<'_>, point: &DVector<f64>) -> Option<DVector<f64>> {
    let found = TRAVELS.iter().filter_map(|travel| {
        let mut without = point.clone();
        without[PRESLIDING_PLACE] = input.coordinates.scales[PRESLIDING_PLACE].coordinate(0.0);
        without[PRESLIDING_TRAVEL_PLACE] = *travel;
        let (step, chi_square) = score(input, &without)?;
        let mut start = without;
        // Half of such a friction at least: near none, the travel has no effect that could be searched.
        start[PRESLIDING_PLACE] = (start[PRESLIDING_PLACE] + step).clamp(0.0, 1.0);
        Some((chi_square, start))
    });
    let (chi_square, start) = found.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (chi_square_tail(chi_square, 1.0) * (TRAVELS.len() as f64) < SEARCHED_LEVEL).then_some(start)
}

/// The step of the part from `point`, and its square in standard deviations: chi-square with one degree of freedom where there is no such
/// friction. `None` where it goes below zero, or where the trials tell no step.
fn score(input: &RigFitInput<'_>, point: &DVector<f64>) -> Option<(f64, f64)> {
    let fit = input.at(point.clone()).ok()?;
    let mut precision = input.prior.precision.clone();
    // Nothing is assumed about the part that is tested.
    precision.fill_row(PRESLIDING_PLACE, 0.0);
    precision.fill_column(PRESLIDING_PLACE, 0.0);
    let mut gradient = &precision * (point - &input.prior.mean);
    let (mut squares, mut count) = (0.0, 0.0);
    for own in &fit.equations {
        gradient += own.jacobian.transpose() * &own.residual;
        squares += own.residual.norm_squared();
        count += own.residual.len() as f64;
    }
    let covariance = inverse(precision + fit.information())?;
    let step = -(covariance.row(PRESLIDING_PLACE) * gradient)[0];
    let variance = covariance[(PRESLIDING_PLACE, PRESLIDING_PLACE)] * (squares / count).max(1.0);
    (step > 0.0 && variance.is_finite()).then(|| (step, step * step / variance))
}
