//! The target's motion, period by period: how it comes to rest, and how it creeps to the start position.

/// Time to the full speed of the way to the start position, for motors whose rig file gives only the speed, s.
const APPROACH_RISE_S: f64 = 0.1;

/// Highest speed and acceleration of a movement that the program plans itself.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Profile {
    /// Highest speed, rad/s at the handle.
    pub speed_rad_s: f64,
    /// Highest acceleration, rad/s2 at the handle.
    pub acceleration_rad_s2: f64,
}

impl Profile {
    /// Of a motor whose rig file gives only the speed of the way to the start position, rad/s.
    pub fn of_speed(speed_rad_s: f64) -> Self {
        Self { speed_rad_s, acceleration_rad_s2: speed_rad_s / APPROACH_RISE_S }
    }
}

/// Where the target is, and how fast it moves.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TargetMotion {
    /// Angle from the start position, rad.
    pub angle_rad: f64,
    /// Speed over the last period, rad/s.
    pub speed_rad_s: f64,
}

impl TargetMotion {
    /// A target that stands still.
    pub fn at_rest(angle_rad: f64) -> Self {
        Self { angle_rad, speed_rad_s: 0.0 }
    }

    /// Whether the target stands still.
    pub fn is_at_rest(&self) -> bool {
        self.speed_rad_s == 0.0
    }

    /// Whether the target is at the goal, and slow enough to have been sent to rest there.
    pub fn has_arrived(&self, goal_rad: f64) -> bool {
        self.angle_rad == goal_rad
    }

    /// The next target on the way to rest.
    pub fn decelerate(&mut self, deceleration_rad_s2: f64, period_s: f64) -> f64 {
        let speed_rad_s = (self.speed_rad_s.abs() - deceleration_rad_s2 * period_s).max(0.0);
        self.advance(speed_rad_s * self.speed_rad_s.signum(), period_s)
    }

    /// The next target on the way to `goal_rad`, where it comes to rest.
    pub fn approach(&mut self, goal_rad: f64, profile: Profile, period_s: f64) -> f64 {
        let left_rad = goal_rad - self.angle_rad;
        let change_rad_s = profile.acceleration_rad_s2 * period_s;
        // With half of the deceleration left in hand, steps of whole periods never exceed the acceleration.
        let braking_rad_s = (profile.acceleration_rad_s2 * left_rad.abs()).sqrt();
        let wanted_rad_s = braking_rad_s.min(profile.speed_rad_s) * left_rad.signum();
        let speed_rad_s =
            wanted_rad_s.clamp(self.speed_rad_s - change_rad_s, self.speed_rad_s + change_rad_s);
        if speed_rad_s * left_rad >= 0.0 && (speed_rad_s * period_s).abs() >= left_rad.abs() {
            *self = Self { angle_rad: goal_rad, speed_rad_s: left_rad / period_s };
            return goal_rad;
        }
        self.advance(speed_rad_s, period_s)
    }

    fn advance(&mut self, speed_rad_s: f64, period_s: f64) -> f64 {
        self.speed_rad_s = speed_rad_s;
        self.angle_rad += speed_rad_s * period_s;
        self.angle_rad
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PERIOD_S: f64 = 0.002;

    #[test]
    fn deceleration_comes_to_rest_after_the_distance_of_constant_deceleration() {
        let mut motion = TargetMotion { angle_rad: 0.0, speed_rad_s: -3.0 };
        while !motion.is_at_rest() {
            motion.decelerate(60.0, PERIOD_S);
        }
        assert!((motion.angle_rad + 3.0 * 3.0 / 120.0).abs() < 3.0 * PERIOD_S, "{motion:?}");
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn an_approach_arrives_within_speed_and_acceleration(
            from_rad in -0.5..0.5f64, speed in 0.01..2.0f64, acceleration in 0.5..400.0f64
        ) {
            let profile = Profile { speed_rad_s: speed, acceleration_rad_s2: acceleration };
            let mut motion = TargetMotion::at_rest(from_rad);
            let mut before = motion;
            let mut periods = 0;
            while motion.angle_rad != 0.0 {
                motion.approach(0.0, profile, PERIOD_S);
                prop_assert!(motion.speed_rad_s.abs() <= speed * (1.0 + 1e-9));
                let change = (motion.speed_rad_s - before.speed_rad_s).abs();
                prop_assert!(change <= acceleration * PERIOD_S * (1.0 + 1e-6), "{before:?} {motion:?}");
                before = motion;
                periods += 1;
                prop_assert!(periods < 100_000);
            }
            prop_assert!(motion.speed_rad_s.abs() <= acceleration * PERIOD_S * (1.0 + 1e-6));
        }
    }
}
