//! Whether a low-pass of the torque channel that the trials seem to show is one.
//!
//! At low frequencies a low-pass beside a torque that is early by its time constant does nothing. Trials without high frequencies know the two
//! together and hardly each of them, and in one rig of twenty the interval of the time constant does not contain zero. Both are then far
//! from what channels have, and whatever is fitted with them is wrong. So the rig is compared with and without a low-pass, by what is
//! known of sound channels and of faulty ones.

use super::constants::{DELAY_PLACE, LAG_PLACE};
use super::error::CalibrateError;
use super::fit::{RigFit, RigFitInput};
use super::reported::{Reported, stated};
use super::rig_deviations::RigDeviations;
use super::sound_rig::SOUND_DELAY_S;
use super::stated_rig::probability_of_fault;
use crate::dataset::{RigCalibration, RigQuantity};
use crate::statistics::HALF_INTERVAL_95;
use crate::wrist::Lever;
use crate::wrist::mechanisms::MechanismKind;

/// Probability of a low-pass below which there is none.
const PROBABLE: f64 = 0.5;

/// A rig without the low-pass that a fit has.
pub struct WithoutLowPass {
    /// The fit without it.
    pub fit: RigFit,
    /// Why it has none.
    pub reason: String,
    /// What a low-pass lies above (95 %), Hz.
    pub above_hz: f64,
}

/// A fit without the low-pass that `fit` has, as `reported`, if the rig probably has none.
///
/// # Errors
/// As [`RigFitInput::fit`].
pub fn without_low_pass(
    input: &mut RigFitInput<'_>,
    fit: &RigFit,
    reported: &Reported,
    lever: Option<Lever>,
) -> Result<Option<WithoutLowPass>, CalibrateError> {
    let Reported { quantities, covariance } = reported.clone();
    let told = RigCalibration::new(String::new(), String::new(), quantities, covariance);
    let cutoff = told.value(RigQuantity::TorqueCutoff).zip(told.se(RigQuantity::TorqueCutoff));
    let Some((cutoff_hz, se)) = cutoff else { return Ok(None) };
    let deviations = RigDeviations::of(&told, |quantity| stated(quantity, lever));
    if probability_of_fault(&deviations, MechanismKind::TorqueLag) >= PROBABLE {
        return Ok(None);
    }
    let [delay, lag] = [DELAY_PLACE, LAG_PLACE].map(|place| input.coordinates.scales[place]);
    let precision = lag.range() / SOUND_DELAY_S;
    input.prior.mean[LAG_PLACE] = lag.coordinate(0.0);
    input.prior.precision[(LAG_PLACE, LAG_PLACE)] = precision * precision;
    let mut start = fit.point.clone();
    let whole_s = delay.value(start[DELAY_PLACE]) + lag.value(start[LAG_PLACE]);
    start[DELAY_PLACE] = delay.coordinate(whole_s);
    start[LAG_PLACE] = lag.coordinate(0.0);
    let slowest_hz = RigQuantity::TorqueCutoff.off_by(cutoff_hz, se, -HALF_INTERVAL_95);
    let reason = format!(
        "a low-pass of {cutoff_hz:.0} Hz would fit slightly better, but only with a torque that is early by as much as it delays, which \
         is improbable in any channel; these trials exclude one below {slowest_hz:.0} Hz (95 %)"
    );
    Ok(Some(WithoutLowPass { fit: input.fit(&start)?, reason, above_hz: slowest_hz }))
}
