//! Whether the stated value of each load agrees with the other loads.

use super::constants::{FIRST_KNOWN, RigCoordinates};
use super::covariance::{INTERVAL, NOTHING_KNOWN, RigCovariance, inverse};
use super::fit::{RigFit, RigFitInput};
use crate::protocol::RigLoad;
use crate::statistics::{holm, t_two_sided};
use nalgebra::{DMatrix, DVector};

/// Degrees of freedom of a normal distribution, for the t-test that the standard errors already contain.
const MANY: f64 = 1e9;

/// Significance level of a load that disagrees, over all loads.
const LEVEL: f64 = 0.05;

/// What the other loads say of a load's value.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadCheck {
    /// The load, without direction.
    pub load: RigLoad,
    /// True over stated value as the other loads have it, less one; `None` if they cannot tell.
    pub difference: Option<f64>,
    /// Standard error of the difference, with the error of the stated value.
    pub se: f64,
    /// Probability of a difference this large if all stated values are right, adjusted for the number of loads by Holm's method.
    pub p_value: f64,
    /// Other loads that explain the disagreement as well: one of them may be wrong in its place.
    pub or: Vec<RigLoad>,
}

impl LoadCheck {
    /// Whether the load disagrees with the others.
    pub fn disagrees(&self) -> bool {
        self.difference.is_some() && self.p_value < LEVEL
    }
}

/// Compares each load with the others: its factor is fitted anew without its stated value, by one step from the fit.
///
/// The step starts from the slope of the cost where the fit ended. A fit that ends a tenth of a standard error before its optimum is close
/// enough for every constant, and still far for a load that the others tell a hundred times less well than its stated value does.
pub fn check_loads(input: &RigFitInput<'_>, fit: &RigFit, covariance: &RigCovariance) -> Vec<LoadCheck> {
    let coordinates = &input.coordinates;
    let precision = input.prior.precision.diagonal();
    let first = RigCoordinates::first_load();
    // The covariance allows for more than the noise model has: the check as well.
    let model = inverse(
        &covariance.information + DMatrix::identity(coordinates.count(), coordinates.count()) * NOTHING_KNOWN,
    );
    let deviation = &fit.point - &input.prior.mean;
    let mut gradient = DVector::from_fn(coordinates.count(), |place, _| {
        if place < FIRST_KNOWN { 0.0 } else { precision[place] * deviation[place] }
    });
    for equations in &fit.equations {
        gradient += equations.jacobian.transpose() * &equations.residual;
    }
    let mut checks: Vec<LoadCheck> = coordinates
        .loads
        .iter()
        .enumerate()
        .map(|(index, load)| {
            let place = first + index;
            let mut without = covariance.information.clone();
            without[(place, place)] -= precision[place];
            for own in 0..coordinates.count() {
                without[(own, own)] += NOTHING_KNOWN;
            }
            let inverse = inverse(without);
            let variance = inverse[(place, place)];
            let growth = covariance.covariance[(place, place)] / model[(place, place)];
            let se = libm::sqrt(variance * growth.max(1.0) + 1.0 / precision[place]);
            let mut slope = gradient.clone();
            slope[place] -= precision[place] * deviation[place];
            let shift = fit.point[place] - (&inverse * slope)[place];
            // An interval wider than the value itself tells nothing about the value.
            let told = INTERVAL * libm::sqrt(variance) < 1.0;
            LoadCheck { load: *load, difference: told.then_some(shift), se, p_value: 1.0, or: Vec::new() }
        })
        .collect();
    let told: Vec<usize> = (0..checks.len()).filter(|index| checks[*index].difference.is_some()).collect();
    let z = |check: &LoadCheck| check.difference.unwrap_or(0.0) / check.se;
    let p: Vec<f64> = told.iter().map(|index| t_two_sided(z(&checks[*index]), MANY)).collect();
    for (index, p_value) in told.iter().zip(holm(&p)) {
        checks[*index].p_value = p_value;
    }
    let squares: Vec<f64> = checks.iter().map(|check| z(check) * z(check)).collect();
    for index in 0..checks.len() {
        // A load whose removal lowers the misfit as far, within what chance does, is not told from this one.
        let as_well =
            |other: &usize| *other != index && squares[*other] > squares[index] - INTERVAL * INTERVAL;
        if checks[index].disagrees() {
            let or = (0..checks.len()).filter(as_well).filter(|other| checks[*other].disagrees());
            checks[index].or = or.map(|other| checks[other].load).collect();
        }
    }
    checks
}
