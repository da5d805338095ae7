//! Whether the objects of a CiA 402 drive can hold what a rig file asks of them. A number that is too large for its object
//! would become the largest that it holds, and a limit that is less than a count of the drive would become 0, which means no
//! limit in some objects: the drive would not do what the dry run was made with.

use super::motors::Cia402Motor;
use super::rig_file::RigLimits;
use crate::rig::can::units::{Gearing, JointAngle, JointTorque};

/// Largest number of a following error window (6065h): one more means that no following error is found.
const LARGEST_WINDOW: f64 = u32::MAX as f64 - 1.0;

/// What to do about a number that its object cannot hold.
const REMEDY: &str = "change the value, or the gear or the scale of the encoder";

/// A number of the rig file in the unit of the drive.
struct DriveNumber {
    field: &'static str,
    object: &'static str,
    /// In the object's unit, with its sign.
    value: f64,
    smallest: f64,
    largest: f64,
}

/// Every number of `motor` and `limits` that its object in the drive cannot hold: the field, what was expected, and what to do.
pub fn unholdable(motor: &Cia402Motor, limits: &RigLimits) -> Vec<(&'static str, String, &'static str)> {
    let gearing = Gearing::new(motor.counts_per_revolution, motor.gear_ratio, motor.rated_torque_nm);
    let numbers = limit_numbers(&gearing, limits).into_iter().chain(motor_numbers(&gearing, motor, limits));
    numbers
        .filter(|number| !(number.smallest..=number.largest).contains(&number.value.abs()))
        .map(|DriveNumber { field, object, value, smallest, largest }| {
            let expected = format!(
                "a value whose number in {object} of the drive is from {smallest} to {largest}; this one is {}",
                value.abs()
            );
            (field, expected, REMEDY)
        })
        .collect()
}

fn limit_numbers(gearing: &Gearing, limits: &RigLimits) -> Vec<DriveNumber> {
    let [low, high] = limits.angle_rad.map(|rad| gearing.unbounded_counts(JointAngle(rad)));
    let number = |field, object, value, largest| DriveNumber { field, object, value, smallest: 1.0, largest };
    let (positions, counts) = (f64::from(i32::MAX), f64::from(u32::MAX));
    let window = gearing.unbounded_length(limits.following_error_rad);
    let torque = gearing.unbounded_torque(JointTorque(limits.motor_torque_nm));
    vec![
        // Both ends at 0 mean that there are no ends.
        number("limits.angle_rad", "607Dh and 607Ah", low, positions),
        number("limits.angle_rad", "607Dh and 607Ah", high, positions),
        number("limits.speed_rad_s", "6080h", gearing.unbounded_rpm(limits.speed_rad_s), counts),
        number("limits.motor_torque_nm", "6072h", torque, f64::from(u16::MAX)),
        number("limits.following_error_rad", "6065h", window, LARGEST_WINDOW),
    ]
}

fn motor_numbers(gearing: &Gearing, motor: &Cia402Motor, limits: &RigLimits) -> Vec<DriveNumber> {
    let homing = &motor.homing;
    let homed = gearing.with_home(JointAngle(homing.offset_rad));
    let number = |field, object, rad, smallest| DriveNumber {
        field,
        object,
        value: gearing.unbounded_length(rad),
        smallest,
        largest: f64::from(u32::MAX),
    };
    // The limits are counted from home. Without an offset their own fields tell what does not fit.
    let ends = limits.angle_rad.map(|rad| homed.unbounded_counts(JointAngle(rad)).abs());
    let furthest = if homing.offset_rad == 0.0 { 0.0 } else { ends[0].max(ends[1]) };
    // A method that takes the present position does not use them.
    let used = if homing.takes_present_position() { 0.0 } else { 1.0 };
    vec![
        number("motor.quick_stop_rad_s2", "6085h", motor.quick_stop_rad_s2, 1.0),
        number("motor.homing.fast_rad_s", "6099h:01", homing.fast_rad_s, used),
        number("motor.homing.slow_rad_s", "6099h:02", homing.slow_rad_s, used),
        number("motor.homing.acceleration_rad_s2", "609Ah", homing.acceleration_rad_s2, used),
        DriveNumber {
            field: "motor.homing.offset_rad",
            object: "607Dh and 607Ah",
            value: furthest,
            smallest: 0.0,
            largest: f64::from(i32::MAX),
        },
    ]
}
