//! The last check of every target: none leaves the angle limits, steps further than the speed limit allows in a period, or
//! changes its speed by more than the acceleration limit allows in a period.

use super::fault::CanFault;
use super::limits::HandleLimits;
use super::target_motion::TargetMotion;

/// Rounding of targets that were computed to be exactly at a limit.
const ROUNDING: f64 = 1.0 + 1e-6;

/// Checks each target against those that the motor has been given before.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetGuard {
    limits: HandleLimits,
    period_s: f64,
    /// The latest target that was given, rad, and its speed, rad/s.
    given: TargetMotion,
}

impl TargetGuard {
    /// Before the first target, which must be near `at_rad`: the handle stands there.
    pub fn new(limits: HandleLimits, period_s: f64, at_rad: f64) -> Self {
        Self { limits, period_s, given: TargetMotion::at_rest(at_rad) }
    }

    /// Where the latest target is, and how fast it moves.
    pub fn given(&self) -> TargetMotion {
        self.given
    }

    /// A target was given: SYNC was sent after it.
    pub fn give(&mut self, target_rad: f64) {
        let speed_rad_s = (target_rad - self.given.angle_rad) / self.period_s;
        self.given = TargetMotion { angle_rad: target_rad, speed_rad_s };
    }

    /// The handle stands at an angle: where it gets power, or where it came to its latest target and got no other.
    pub fn stand(&mut self, at_rad: f64) {
        self.given = TargetMotion::at_rest(at_rad);
    }

    /// Whether a target may be given next.
    ///
    /// # Errors
    /// [`CanFault::CommandBeyondLimit`] or [`CanFault::CommandTooFast`]
    pub fn check(&self, target_rad: f64) -> Result<(), CanFault> {
        self.check_up_to(self.limits.speed_rad_s, target_rad)
    }

    /// Whether a target may be given next that must not move faster than the one before.
    ///
    /// # Errors
    /// [`CanFault::CommandBeyondLimit`] or [`CanFault::CommandTooFast`]
    pub fn check_coming_to_rest(&self, target_rad: f64) -> Result<(), CanFault> {
        // The step between angles of some 0.1 rad is rounded to 1e-16 rad.
        let rounding_rad_s = 1e-12 / self.period_s;
        self.check_up_to(self.given.speed_rad_s.abs() + rounding_rad_s, target_rad)
    }

    fn check_up_to(&self, most_rad_s: f64, target_rad: f64) -> Result<(), CanFault> {
        self.limits.check_target(target_rad)?;
        let speed_rad_s = (target_rad - self.given.angle_rad) / self.period_s;
        let acceleration_rad_s2 = (speed_rad_s - self.given.speed_rad_s) / self.period_s;
        let most_rad_s2 = self.limits.acceleration_rad_s2;
        if speed_rad_s.abs() > most_rad_s * ROUNDING || acceleration_rad_s2.abs() > most_rad_s2 * ROUNDING {
            return Err(CanFault::CommandTooFast {
                speed_rad_s,
                acceleration_rad_s2,
                most_rad_s,
                most_rad_s2,
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rig::can::limits::EXAMPLE_LIMITS as LIMITS;

    #[test]
    fn a_step_that_is_too_fast_or_too_sudden_is_refused() {
        let mut guard = TargetGuard::new(LIMITS, 0.002, 0.0);
        assert!(matches!(guard.check(0.01), Err(CanFault::CommandTooFast { .. })), "5 rad/s");
        assert!(matches!(guard.check(0.002), Err(CanFault::CommandTooFast { .. })), "500 rad/s2 from rest");
        assert_eq!(guard.check(0.0016), Ok(()), "400 rad/s2");
        guard.give(0.0016);
        assert_eq!(guard.check(0.0048), Ok(()));
        guard.give(0.0048);
        assert!(
            matches!(guard.check(0.0048), Err(CanFault::CommandTooFast { .. })),
            "it cannot stand at once"
        );
    }

    #[test]
    fn a_target_that_comes_to_rest_never_gets_faster() {
        let mut guard = TargetGuard::new(LIMITS, 0.002, 0.0);
        guard.give(0.0010);
        assert!(guard.check_coming_to_rest(0.0022).is_err(), "0.6 after 0.5 rad/s");
        assert_eq!(guard.check_coming_to_rest(0.0020), Ok(()));
    }

    #[test]
    fn a_target_beyond_the_angles_or_not_a_number_is_refused() {
        let guard = TargetGuard::new(LIMITS, 0.002, 0.1999);
        assert!(matches!(guard.check(0.2001), Err(CanFault::CommandBeyondLimit { .. })));
        assert!(matches!(guard.check(f64::NAN), Err(CanFault::CommandBeyondLimit { .. })));
    }
}
