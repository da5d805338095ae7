//! The limits in force: the tighter of rig and protocol, held by the drive and, every cycle, by the program.

use super::fault::CanFault;
use super::file::RigLimits;
use crate::protocol::Limits;

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

/// Proof that a drive read back every limit as it was written. Only a drive's own `prepare` makes one.
#[derive(Debug)]
pub struct Confirmed(());

impl Confirmed {
    /// To be called where every limit was just read back, and nowhere else.
    pub(super) fn by_reading_back() -> Self {
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

    /// Whether the motor may be sent to an angle. NaN is nowhere.
    pub fn let_pass(&self, angle_rad: f64) -> Result<(), CanFault> {
        let [low_rad, high_rad] = self.angle_rad;
        if (low_rad..=high_rad).contains(&angle_rad) {
            return Ok(());
        }
        Err(CanFault::CommandBeyondLimit { angle_rad, low_rad, high_rad })
    }
}

/// Over how many samples the speed is taken: one count in one sample would already look fast.
const SPEED_SAMPLES: usize = 4;

/// Holds what is measured against the limits, sample by sample.
#[derive(Debug, Clone)]
pub struct Guard {
    limits: HandleLimits,
    sample_period_s: f64,
    angles_rad: [f64; SPEED_SAMPLES],
    seen: usize,
}

impl Guard {
    /// Before the first sample.
    pub fn new(limits: HandleLimits, sample_period_s: f64) -> Self {
        Self { limits, sample_period_s, angles_rad: [0.0; SPEED_SAMPLES], seen: 0 }
    }

    /// The limits it holds.
    pub fn limits(&self) -> &HandleLimits {
        &self.limits
    }

    /// One sample. What is not a number is beyond every limit.
    pub fn check(&mut self, angle_rad: f64, torque_nm: f64) -> Result<(), CanFault> {
        let [low_rad, high_rad] = self.limits.angle_rad;
        if !(low_rad..=high_rad).contains(&angle_rad) {
            let limit_rad = if angle_rad < low_rad { low_rad } else { high_rad };
            return Err(CanFault::Angle { angle_rad, limit_rad });
        }
        let slot = self.seen % SPEED_SAMPLES;
        let before_rad = std::mem::replace(&mut self.angles_rad[slot], angle_rad);
        self.seen += 1;
        if self.seen > SPEED_SAMPLES {
            let speed_rad_s = (angle_rad - before_rad) / (self.sample_period_s * SPEED_SAMPLES as f64);
            let limit_rad_s = self.limits.speed_rad_s;
            if speed_rad_s.abs() > limit_rad_s {
                return Err(CanFault::Speed { speed_rad_s, limit_rad_s });
            }
        }
        self.check_torque(torque_nm)
    }

    /// The torque alone, where angles mean nothing.
    pub fn check_torque(&self, torque_nm: f64) -> Result<(), CanFault> {
        let limit_nm = self.limits.torque_nm;
        // A torque that is no number is told by the session, which knows the channel; here it must not look small.
        if torque_nm.abs() > limit_nm {
            return Err(CanFault::Torque { torque_nm, limit_nm });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: HandleLimits = HandleLimits {
        angle_rad: [-0.05, 0.2],
        speed_rad_s: 4.0,
        acceleration_rad_s2: 400.0,
        torque_nm: 20.0,
        motor_torque_nm: 30.0,
        following_error_rad: 0.05,
        following_error_ms: 10,
    };

    #[test]
    fn a_jump_is_a_speed_and_a_speed_is_seen_in_four_samples() {
        let mut guard = Guard::new(LIMITS, 1e-3);
        for _ in 0..10 {
            assert_eq!(guard.check(0.0, 0.0), Ok(()));
        }
        assert!(matches!(guard.check(0.1, 0.0), Err(CanFault::Speed { .. })));
    }

    #[test]
    fn the_first_samples_have_no_speed() {
        let mut guard = Guard::new(LIMITS, 1e-3);
        assert_eq!(guard.check(0.15, 0.0), Ok(()));
    }

    #[test]
    fn what_is_beyond_or_not_a_number_is_stopped() {
        let check = |angle, torque| Guard::new(LIMITS, 1e-3).check(angle, torque);
        assert!(matches!(check(0.21, 0.0), Err(CanFault::Angle { limit_rad: 0.2, .. })));
        assert!(matches!(check(-0.06, 0.0), Err(CanFault::Angle { limit_rad: -0.05, .. })));
        assert!(matches!(check(f64::NAN, 0.0), Err(CanFault::Angle { .. })));
        assert!(matches!(check(0.0, -20.1), Err(CanFault::Torque { .. })));
        assert!(
            LIMITS.let_pass(f64::NAN).is_err()
                && LIMITS.let_pass(0.2001).is_err()
                && LIMITS.let_pass(0.2).is_ok()
        );
    }
}
