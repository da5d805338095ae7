//! Whether the motor moves as far and as fast as it is told. A drive may report its position in one unit and take targets or speeds in
//! another; a slow motion shows that before a limb is in. It does not show a wrong number of counts for a turn, or a wrong gear ratio:
//! targets and positions go through the same factor.

use std::time::Instant;

use super::fault::CanFault;

/// How much faster than asked for a motion may be measured, as a factor: control loops overshoot.
pub const SPEED_TOLERANCE: f64 = 1.5;
/// Periods in a row that must be too fast. One is a disturbed reading, or an origin that moved when home was found.
const TOO_FAST_PERIODS: u32 = 3;
/// How far a motion may differ from what was asked for, as a fraction.
const LENGTH_TOLERANCE: f64 = 0.2;
/// Steps of the encoder by which a measured length may be wrong besides.
const LENGTH_STEPS: f64 = 3.0;

/// Compares the speed between readings with the one that was asked for, while a drive moves.
#[derive(Debug, Clone, Copy)]
pub struct SpeedWatch {
    asked_rad_s: f64,
    resolution_rad: f64,
    /// How many times slower than its own time the emulated motor runs.
    time_stretch: f64,
    before: Option<(f64, Instant)>,
    too_fast: u32,
}

impl SpeedWatch {
    /// For a motion of at most `asked_rad_s` at the handle, measured in steps of `resolution_rad`.
    pub fn new(asked_rad_s: f64, resolution_rad: f64, time_stretch: f64) -> Self {
        Self { asked_rad_s, resolution_rad, time_stretch, before: None, too_fast: 0 }
    }

    /// The handle's angle in one more period, read at `now`.
    ///
    /// # Errors
    /// [`CanFault::FasterThanAsked`]
    pub fn observe(&mut self, angle_rad: f64, now: Instant) -> Result<(), CanFault> {
        let Some((before_rad, then)) = self.before.replace((angle_rad, now)) else { return Ok(()) };
        let elapsed_s = now.saturating_duration_since(then).as_secs_f64() / self.time_stretch;
        if elapsed_s <= 0.0 {
            return Ok(());
        }
        let measured_rad_s = (angle_rad - before_rad).abs() / elapsed_s;
        let most_rad_s = SPEED_TOLERANCE * self.asked_rad_s + 2.0 * self.resolution_rad / elapsed_s;
        self.too_fast = if measured_rad_s > most_rad_s { self.too_fast + 1 } else { 0 };
        if self.too_fast < TOO_FAST_PERIODS {
            return Ok(());
        }
        Err(CanFault::FasterThanAsked { measured_rad_s, asked_rad_s: self.asked_rad_s })
    }
}

/// Compares a slow motion along targets with what is measured: no faster in any period, and as long in the end.
#[derive(Debug, Clone, Copy)]
pub struct MotionProof {
    speed: SpeedWatch,
    resolution_rad: f64,
    /// Target and angle at the first period.
    from: Option<[f64; 2]>,
    /// The target farthest from the first one.
    farthest_rad: f64,
    /// How far the handle was from its first angle in the direction of the farthest target, at most and against it.
    moved_rad: [f64; 2],
}

impl MotionProof {
    /// Length of a motion that shows the scale when the handle is at the start position already, rad.
    pub const LENGTH_RAD: f64 = 0.005;

    /// For targets that move by at most `asked_rad_s`; the angle is measured in steps of `resolution_rad`.
    pub fn new(asked_rad_s: f64, resolution_rad: f64, time_stretch: f64) -> Self {
        Self {
            speed: SpeedWatch::new(asked_rad_s, resolution_rad, time_stretch),
            resolution_rad,
            from: None,
            farthest_rad: 0.0,
            moved_rad: [0.0; 2],
        }
    }

    /// The target and the handle's angle of one more period, read at `now`.
    ///
    /// # Errors
    /// [`CanFault::FasterThanAsked`]
    pub fn observe(&mut self, target_rad: f64, angle_rad: f64, now: Instant) -> Result<(), CanFault> {
        self.speed.observe(angle_rad, now)?;
        let [first_target_rad, first_rad] = *self.from.get_or_insert([target_rad, angle_rad]);
        let asked_rad = target_rad - first_target_rad;
        if asked_rad.abs() > self.farthest_rad.abs() {
            self.farthest_rad = asked_rad;
        }
        let moved_rad = angle_rad - first_rad;
        self.moved_rad = [self.moved_rad[0].min(moved_rad), self.moved_rad[1].max(moved_rad)];
        Ok(())
    }

    /// Whether targets have gone far enough to tell.
    pub fn is_long_enough(&self) -> bool {
        self.farthest_rad.abs() >= Self::LENGTH_RAD
    }

    /// After the motor came to rest: the motion must have been as long as it was asked for.
    ///
    /// # Errors
    /// [`CanFault::MovedOtherwise`]
    pub fn finish(&self) -> Result<(), CanFault> {
        let asked_rad = self.farthest_rad.abs();
        let [low, high] = self.moved_rad;
        let (moved_rad, against_rad) = if self.farthest_rad < 0.0 { (-low, high) } else { (high, -low) };
        let tolerance_rad = LENGTH_TOLERANCE * asked_rad + LENGTH_STEPS * self.resolution_rad;
        if (moved_rad - asked_rad).abs() <= tolerance_rad && against_rad <= tolerance_rad {
            return Ok(());
        }
        let moved_rad = if against_rad > moved_rad { -against_rad } else { moved_rad };
        Err(CanFault::MovedOtherwise { moved_rad, asked_rad })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    const PERIOD: Duration = Duration::from_millis(1);

    /// A motion of 5 mrad and back at 0.05 rad/s, which the motor makes `scale` times as large.
    fn prove(scale: f64) -> Result<(), CanFault> {
        let start = Instant::now();
        let mut proof = MotionProof::new(0.05, 5e-5, 1.0);
        for period in 0..=200u32 {
            let target_rad = 5e-5 * f64::from(100 - period.abs_diff(100));
            proof.observe(target_rad, 0.1 + scale * target_rad, start + PERIOD * period)?;
        }
        assert!(proof.is_long_enough());
        proof.finish()
    }

    #[test]
    fn a_motor_that_moves_as_it_is_told_passes() {
        for scale in [0.9, 1.0, 1.1] {
            assert_eq!(prove(scale), Ok(()), "{scale}");
        }
    }

    #[test]
    fn a_motor_of_another_scale_or_direction_does_not_pass() {
        for scale in [0.0, 0.5, -1.0, 1.4] {
            assert!(
                matches!(prove(scale), Err(CanFault::MovedOtherwise { .. })),
                "{scale}: {:?}",
                prove(scale)
            );
        }
    }

    #[test]
    fn a_motor_that_is_much_too_fast_is_found_in_a_few_periods() {
        let start = Instant::now();
        let mut watch = SpeedWatch::new(0.3, 5e-5, 1.0);
        let found = (0..100u32)
            .find(|period| watch.observe(3.98e-3 * f64::from(*period), start + PERIOD * *period).is_err());
        assert_eq!(found, Some(TOO_FAST_PERIODS));
    }

    #[test]
    fn an_origin_that_moves_once_is_no_speed() {
        let start = Instant::now();
        let mut watch = SpeedWatch::new(0.3, 5e-5, 1.0);
        for period in 0..100u32 {
            let origin_rad = if period < 50 { 0.0 } else { 0.15 };
            watch.observe(origin_rad + 3e-4 * f64::from(period), start + PERIOD * period).unwrap();
        }
    }
}
