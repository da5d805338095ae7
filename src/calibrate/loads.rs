//! Whether the stated value of each load agrees with the other loads.

use super::constants::RigCoordinates;
use super::covariance::{INTERVAL, NOTHING_KNOWN};
use super::error::CalibrateError;
use super::fit::{ReleasedFit, RigFit, RigFitInput};
use super::stated_rig::LoadByRig;
use crate::protocol::RigLoad;
use crate::statistics::{chi_square_tail, holm};

/// Significance level of a load that disagrees, over all loads. A load in a hundred is wrong, by some 15 % (assumed): where chance makes a
/// larger difference in one case of a thousand, a wrong load becomes the likelier explanation.
pub const LOAD_LEVEL: f64 = 0.001;

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
    /// What the rig as the session states it says of the load; `None` where the other loads tell it.
    pub by_rig: Option<LoadByRig>,
}

impl LoadCheck {
    /// Whether the load disagrees with the others.
    pub fn disagrees(&self) -> bool {
        self.difference.is_some() && self.p_value < LOAD_LEVEL
    }

    /// What the rig as stated says of the load, if it is more probably wrong than right.
    pub fn wrong_by_rig(&self) -> Option<LoadByRig> {
        self.by_rig.filter(|own| own.probability > 0.5)
    }
}

/// Compares each load with the others: all constants are fitted anew without its stated value, and the costs of both fits are compared.
///
/// A fit, and no step from the fit with the stated value; costs, and no standard errors: the others tell a load up to a hundred times less
/// well than its stated value does, and so far away neither slope nor curvature is that of the stated value.
///
/// # Errors
/// As [`RigFitInput::fit`].
pub fn check_loads(input: &RigFitInput<'_>, fit: &RigFit) -> Result<Vec<LoadCheck>, CalibrateError> {
    let (mut checks, mut gains) = (Vec::new(), Vec::new());
    let places = (RigCoordinates::first_load()..).take(input.coordinates.loads.len());
    let released = input.released(fit, places.clone(), NOTHING_KNOWN)?;
    for ((place, load), own) in places.zip(&input.coordinates.loads).zip(released) {
        let ReleasedFit { value, se, gain } = own;
        let stated = input.prior.precision[(place, place)];
        let se_with_stated = libm::hypot(se, 1.0 / libm::sqrt(stated));
        // An interval wider than the value itself tells nothing about the value.
        let told = INTERVAL * se < 1.0;
        // Nor does a load disagree whose interval holds the stated value: then the costs of two searches differ, and not the loads.
        let is_elsewhere = value.abs() > INTERVAL * se_with_stated;
        gains.push(if told && is_elsewhere { gain } else { 0.0 });
        checks.push(LoadCheck {
            load: *load,
            difference: told.then_some(value),
            se: se_with_stated,
            p_value: 1.0,
            or: Vec::new(),
            by_rig: None,
        });
    }
    let told: Vec<usize> = (0..checks.len()).filter(|index| checks[*index].difference.is_some()).collect();
    let p: Vec<f64> = told.iter().map(|index| chi_square_tail(gains[*index].max(0.0), 1.0)).collect();
    for (index, p_value) in told.iter().zip(holm(&p)) {
        checks[*index].p_value = p_value;
    }
    for index in 0..checks.len() {
        // A load whose removal lowers the misfit as far, within what chance does, is not told from this one.
        let as_well = |other: &usize| *other != index && gains[*other] > gains[index] - INTERVAL * INTERVAL;
        if checks[index].disagrees() {
            let or = (0..checks.len()).filter(as_well).filter(|other| checks[*other].disagrees());
            checks[index].or = or.map(|other| checks[other].load).collect();
        }
    }
    Ok(checks)
}
