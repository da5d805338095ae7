//! The limits in force: the tighter of rig and protocol, held by the drive and, every cycle, by the program.

use super::fault::CanFault;
use super::file::RigLimits;
use super::units::JointAngle;
use crate::protocol::Limits;
use crate::rig::{Channel, MotionLimits};

/// What the handle may never exceed, in this session.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HandleLimits {
    /// Lowest and highest angle from the start position, rad.
    pub angle_rad: [f64; 2],
    /// Highest speed, rad/s.
    pub speed_rad_s: f64,
    /// Highest acceleration of a planned movement, rad/s2.
    pub acceleration_rad_s2: f64,
    /// Highest measured torque, N m, either sign.
    pub torque_nm: f64,
    /// Highest torque of the motor at the handle, N m.
    pub motor_torque_nm: f64,
    /// How far the handle may be from where it should be, rad.
    pub following_error_rad: f64,
    /// For how long it may be, ms.
    pub following_error_ms: u16,
}

/// Proof that the limits hold: a drive read back every one as it was written, or has none and the rig file says so. Only a drive's own
/// `prepare` makes one.
#[derive(Debug)]
pub struct LimitsConfirmed(());

impl LimitsConfirmed {
    /// To be called where every limit was just read back, and nowhere else.
    pub(super) fn by_reading_back() -> Self {
        Self(())
    }

    /// To be called of a motor that has no limits, and of which the rig file says so (`has_no_limits_of_its_own`), after its reach was
    /// checked: the program alone holds them.
    pub(super) fn held_by_program() -> Self {
        Self(())
    }
}

impl HandleLimits {
    /// The tighter of each.
    pub fn tighter(rig: &RigLimits, protocol: &Limits) -> Self {
        Self {
            angle_rad: [
                rig.angle_rad[0].max(protocol.angle_rad[0]),
                rig.angle_rad[1].min(protocol.angle_rad[1]),
            ],
            speed_rad_s: rig.speed_rad_s.min(protocol.speed_rad_s),
            acceleration_rad_s2: rig.acceleration_rad_s2.min(protocol.acceleration_rad_s2),
            torque_nm: rig.torque_nm.min(protocol.torque_nm),
            ..Self::of_rig(rig)
        }
    }

    /// Those of a rig by itself, for looking at it without a protocol.
    pub fn of_rig(rig: &RigLimits) -> Self {
        Self {
            angle_rad: rig.angle_rad,
            speed_rad_s: rig.speed_rad_s,
            acceleration_rad_s2: rig.acceleration_rad_s2,
            torque_nm: rig.torque_nm,
            motor_torque_nm: rig.motor_torque_nm,
            following_error_rad: rig.following_error_rad,
            following_error_ms: rig.following_error_ms,
        }
    }

    /// The limits that measured samples are compared with.
    pub fn measured(&self) -> MotionLimits {
        MotionLimits { angle_rad: self.angle_rad, speed_rad_s: self.speed_rad_s, torque_nm: self.torque_nm }
    }

    /// Whether the handle is within the limits. NaN is nowhere.
    ///
    /// # Errors
    /// [`CanFault::Angle`]
    pub fn check_place(&self, angle: JointAngle) -> Result<(), CanFault> {
        let (JointAngle(angle_rad), [low_rad, high_rad]) = (angle, self.angle_rad);
        if !angle_rad.is_finite() {
            return Err(CanFault::NotANumber { channel: Channel::Angle });
        }
        if (low_rad..=high_rad).contains(&angle_rad) {
            return Ok(());
        }
        Err(CanFault::Angle { angle_rad, limit_rad: if angle_rad < low_rad { low_rad } else { high_rad } })
    }

    /// Whether the motor may be sent to an angle. NaN is nowhere.
    pub fn check_target(&self, angle_rad: f64) -> Result<(), CanFault> {
        let [low_rad, high_rad] = self.angle_rad;
        if (low_rad..=high_rad).contains(&angle_rad) {
            return Ok(());
        }
        Err(CanFault::CommandBeyondLimit { angle_rad, low_rad, high_rad })
    }
}

/// Limits for tests.
#[cfg(test)]
pub const EXAMPLE_LIMITS: HandleLimits = HandleLimits {
    angle_rad: [-0.05, 0.2],
    speed_rad_s: 4.0,
    acceleration_rad_s2: 400.0,
    torque_nm: 20.0,
    motor_torque_nm: 30.0,
    following_error_rad: 0.05,
    following_error_ms: 10,
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_target_beyond_the_limits_or_not_a_number_is_refused() {
        assert!(EXAMPLE_LIMITS.check_target(0.2).is_ok());
        for angle_rad in [0.2001, -0.0501, f64::NAN, f64::INFINITY] {
            assert!(matches!(
                EXAMPLE_LIMITS.check_target(angle_rad),
                Err(CanFault::CommandBeyondLimit { .. })
            ));
        }
    }
}
