//! Between which values a constant of a rig can lie at all, and why.
//!
//! The ranges are those of rigs for a wrist, an ankle or a knee, and wide: what lies beyond is a wrong unit, a slip of the pen or rig trials
//! that cannot have been as stated.

use super::rig_calibration::RigQuantity;
use crate::signal::SLOWEST_CUTOFF_HZ;

/// A constant that is 0 or above may be measured below 0, by so many standard errors.
const STANDARD_ERRORS_BELOW_0: f64 = 3.0;

/// The values that a constant can have.
#[derive(Debug, Clone, Copy)]
pub(super) struct PossibleRange {
    /// Lowest and highest, in the unit of the constant.
    low: f64,
    high: f64,
    /// Why there is nothing beyond.
    why: &'static str,
}

impl PossibleRange {
    /// That of a constant; `None` where the torques of a session decide.
    fn of(quantity: RigQuantity) -> Option<Self> {
        let (low, high, why) = match quantity {
            RigQuantity::LeverInertia => (
                1e-6,
                1.0,
                "a gram at 3 cm has less than the lowest, a handle of 4 kg at half a metre the highest",
            ),
            RigQuantity::LeverDamping => (
                0.0,
                100.0,
                "a lever takes up energy and gives none, and one that is damped more passes no ramp on",
            ),
            RigQuantity::LeverStiffness => (
                1.0,
                1e6,
                "a softer lever turns by a radian at 1 N m, and no handle of a hand's size is stiffer",
            ),
            RigQuantity::TorqueGain | RigQuantity::AngleGain => {
                (1.0 / 3.0, 3.0, "a channel that is off by more is in another unit")
            }
            RigQuantity::TorqueOffset => {
                (-30.0, 30.0, "an offset beyond what a wrist can hold is no zero of an amplifier")
            }
            // Small weights leave it open; RigCalibration::at_torques_up_to holds it against the torques of the session.
            RigQuantity::TorqueNonlinearity => return None,
            RigQuantity::TorqueDelay => {
                (-0.04, 0.04, "a delay of the window that is analysed leaves nothing of it")
            }
            RigQuantity::TorqueCutoff => {
                (SLOWEST_CUTOFF_HZ, 1e6, "a slower channel leaves nothing of the 40 ms that are analysed")
            }
            RigQuantity::ServoBandwidth => (1.0, 1e5, "a slower motor makes no ramp"),
            RigQuantity::BearingFriction => {
                (0.0, 5.0, "friction takes up energy and gives none, and more would hide the wrist")
            }
        };
        Some(Self { low, high, why })
    }
}

/// Whether a rig can have this value of a constant, whose standard error is `se`.
///
/// # Errors
/// What was expected, and why.
pub(super) fn check_possible(quantity: RigQuantity, value: f64, se: f64) -> Result<(), String> {
    let Some(PossibleRange { low, high, why }) = PossibleRange::of(quantity) else { return Ok(()) };
    let below = if low == 0.0 { (STANDARD_ERRORS_BELOW_0 * se).min(0.1 * high) } else { 0.0 };
    if (low - below..=high).contains(&value) {
        return Ok(());
    }
    let rounded = |value: f64| (1e3 * value).round() / 1e3;
    let low = if low.abs() < 1e-3 { low } else { rounded(low) };
    Err(format!(
        "{} is {value}; expected {low} to {}: {why}. Correct its value and unit, or calibrate the rig again",
        quantity.name(),
        rounded(high)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_that_no_rig_has_are_refused_with_the_reason() {
        for (quantity, value, words) in [
            (RigQuantity::BearingFriction, 100.0, "bearing_friction_nm is 100; expected 0 to 5: friction"),
            (RigQuantity::TorqueGain, 5.0, "torque_gain is 5; expected 0.333 to 3: a channel"),
            (RigQuantity::TorqueOffset, 50.0, "torque_offset_nm is 50; expected -30 to 30: an offset"),
            (RigQuantity::LeverDamping, -1.0, "lever_damping_nm_s_per_rad is -1; expected 0 to 100"),
            (RigQuantity::LeverInertia, 16.0, "lever_inertia_kg_m2 is 16; expected 0.000001 to 1"),
            (RigQuantity::LeverStiffness, 0.9, "lever_stiffness_nm_per_rad is 0.9; expected 1 to 1000000"),
            (RigQuantity::AngleGain, 57.3, "angle_gain is 57.3"),
            (RigQuantity::TorqueDelay, 0.4, "torque_delay_s is 0.4; expected -0.04 to 0.04"),
            (RigQuantity::TorqueCutoff, 0.3, "torque_cutoff_hz is 0.3; expected 3.979 to 1000000"),
            (RigQuantity::ServoBandwidth, 0.1, "servo_bandwidth_hz is 0.1; expected 1 to 100000"),
        ] {
            let refused = check_possible(quantity, value, 1e-3).unwrap_err();
            assert!(refused.contains(words), "{refused}");
        }
    }

    #[test]
    fn what_is_measured_as_0_may_be_a_little_below_it() {
        assert!(check_possible(RigQuantity::LeverDamping, -0.02, 0.01).is_ok());
        assert!(check_possible(RigQuantity::BearingFriction, -0.02, 0.01).is_ok());
        assert!(check_possible(RigQuantity::BearingFriction, -0.04, 0.01).is_err());
        assert!(check_possible(RigQuantity::LeverDamping, -50.0, 20.0).is_err());
    }
}
