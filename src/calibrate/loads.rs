//! Whether the stated value of each load agrees with the other loads.

use super::constants::RigCoordinates;
use super::covariance::{INTERVAL, NOTHING_KNOWN, covariance};
use super::fit::{RigFit, RigFitInput};
use crate::protocol::RigLoad;
use crate::statistics::{holm, t_two_sided};

/// Degrees of freedom of a normal distribution, for the t-test that the standard errors already contain.
const MANY: f64 = 1e9;

/// Significance level of a load that disagrees, over all loads. A load in a hundred is wrong, by some 15 % (assumed): where chance makes a
/// larger difference in one case of a thousand, a wrong load becomes the likelier explanation.
const LEVEL: f64 = 0.001;

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

/// Compares each load with the others: all constants are fitted anew without its stated value.
///
/// A fit, and no step from the fit with the stated value: where the others tell a load a hundred times less well than its stated value
/// does, the new optimum may be too far away for the slope at the old one.
pub fn check_loads(input: &RigFitInput<'_>, fit: &RigFit) -> Vec<LoadCheck> {
    let mut checks: Vec<LoadCheck> = (0..input.coordinates.loads.len())
        .map(|index| {
            let place = RigCoordinates::first_load() + index;
            let stated = input.prior.precision[(place, place)];
            let without = input.without_statement_of(place, NOTHING_KNOWN);
            let other = without.fit(&fit.point);
            let variance = covariance(&without, &other).covariance[(place, place)];
            // An interval wider than the value itself tells nothing about the value.
            let told = INTERVAL * libm::sqrt(variance) < 1.0;
            LoadCheck {
                load: input.coordinates.loads[index],
                difference: told.then_some(other.point[place]),
                se: libm::sqrt(variance + 1.0 / stated),
                p_value: 1.0,
                or: Vec::new(),
            }
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
