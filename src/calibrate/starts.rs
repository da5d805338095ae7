//! The fits from several starts, and the choice between them.

use nalgebra::DVector;

use super::constants::{DELAY_PLACE, FRICTION_PLACE, FRICTION_SPEED_PLACE, LAG_PLACE, SERVO_PLACE};
use super::error::CalibrateError;
use super::fit::{RigFit, RigFitInput};
use super::likelihood::CommonProducts;
use super::presliding::presliding_start;
use crate::dataset::time_constant_s;

/// Natural frequencies of the servo at which a search starts, Hz: the median of its mechanism's prior, and a quarter of it.
const SERVO_STARTS_HZ: [f64; 2] = [120.0, 30.0];

/// The most likely of the fits from several starts.
///
/// One start is the rig as stated. At others the servo is found first, from several bandwidths, with the rest as stated: where the motion
/// that follows from the target is not known yet, a search takes what the servo leaves for the handle's. From the likeliest one the search
/// goes on to the places that it is known to miss. Where the trials show a bearing that gives before it slides, `input` gets its
/// coordinates.
///
/// # Errors
/// As [`RigFitInput::fit`].
pub fn fit_from_starts(input: &mut RigFitInput<'_>) -> Result<RigFit, CalibrateError> {
    let mut search = SearchFromStarts { products: CommonProducts::new(input) };
    let mut best = search.fit(input, &input.prior.mean)?;
    let servo = input.coordinates.scales[SERVO_PLACE];
    for frequency_hz in SERVO_STARTS_HZ {
        let mut start = input.prior.mean.clone();
        start[SERVO_PLACE] = servo.coordinate(time_constant_s(frequency_hz));
        best = likelier(best, search.fit(input, &input.fit_servo(&start)?.point)?);
    }
    best = search.go_on(input, best)?;
    let mut with_presliding = input.clone();
    with_presliding.coordinates.has_presliding = true;
    if let Some(start) = presliding_start(&with_presliding, &best.fit.point) {
        let found = search.fit(&with_presliding, &start)?;
        let found = search.go_on(&with_presliding, found)?;
        if found.deviance < best.deviance {
            *input = with_presliding;
            best = found;
        }
    }
    Ok(best.fit)
}

/// A fit and how likely it is.
struct FitFromStart {
    fit: RigFit,
    deviance: f64,
}

fn likelier(best: FitFromStart, other: FitFromStart) -> FitFromStart {
    if other.deviance < best.deviance { other } else { best }
}

/// Fits that are compared under the same products.
struct SearchFromStarts {
    products: CommonProducts,
}

impl SearchFromStarts {
    fn fit(&mut self, input: &RigFitInput<'_>, start: &DVector<f64>) -> Result<FitFromStart, CalibrateError> {
        let fit = input.fit(start)?;
        let deviance = self.products.deviance(input, &fit.point);
        Ok(FitFromStart { fit, deviance })
    }

    /// Goes on to the places that a search is known to miss, to the likeliest of them.
    fn go_on(
        &mut self,
        input: &RigFitInput<'_>,
        mut best: FitFromStart,
    ) -> Result<FitFromStart, CalibrateError> {
        for other in [other_side_of_lag, usual_friction] {
            if let Some(start) = other(input, &best.fit.point) {
                best = likelier(best, self.fit(input, &start)?);
            }
        }
        Ok(best)
    }
}

/// A low-pass and its inverse change the amplitude of the torque alike, and with another delay nearly the phase: the search may end at
/// the inverse.
fn other_side_of_lag(input: &RigFitInput<'_>, point: &DVector<f64>) -> Option<DVector<f64>> {
    let [delay, lag] = [DELAY_PLACE, LAG_PLACE].map(|place| input.coordinates.scales[place]);
    let lag_s = lag.value(point[LAG_PLACE]);
    (lag_s < 0.0).then(|| {
        let mut other = point.clone();
        other[LAG_PLACE] = lag.coordinate(-lag_s);
        other[DELAY_PLACE] = delay.coordinate(delay.value(point[DELAY_PLACE]) + 2.0 * lag_s);
        other
    })
}

/// A friction whose speed ended far from where it started may be no friction: one that rises with all speeds is a damping, and one that
/// is whole at the lowest speed can hardly leave it, since its derivative with the speed is zero.
fn usual_friction(input: &RigFitInput<'_>, point: &DVector<f64>) -> Option<DVector<f64>> {
    let mean = &input.prior.mean;
    let sd = input.coordinates.prior_sd[FRICTION_SPEED_PLACE];
    ((point[FRICTION_SPEED_PLACE] - mean[FRICTION_SPEED_PLACE]).abs() > sd).then(|| {
        let mut other = point.clone();
        for place in [FRICTION_PLACE, FRICTION_SPEED_PLACE] {
            other[place] = mean[place];
        }
        other
    })
}
