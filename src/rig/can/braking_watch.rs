//! Whether a drive does the quick stop that it was told: it begins in time, and the handle becomes slower.

use super::fault::CanFault;

/// Periods that a drive may take to begin a quick stop, or to switch its power off, as its frames tell it: one to SYNC, one to act,
/// one to report.
pub const PERIODS_TO_OBEY: u32 = 3;
/// Part of the deceleration that must be seen: ramps with a limited jerk begin gently.
const BRAKING_PART: f64 = 0.5;
/// Speed at which the handle may be as long as it likes, rad/s: a servo settles, and a hand moves the handle a little.
const SETTLING_RAD_S: f64 = 0.2;
/// Periods in a row in which the handle must be too fast: one is a disturbed reading.
const NOT_BRAKING_PERIODS: u32 = 2;

/// Watches one quick stop.
#[derive(Debug)]
pub struct BrakingWatch {
    deceleration_rad_s2: f64,
    resolution_rad: f64,
    period_s: f64,
    /// Periods since the quick stop was sent, and those of them with new readings.
    periods: u32,
    seen: u32,
    before: Option<(f64, u32)>,
    /// Highest speed in the periods in which the drive may still begin.
    begun_rad_s: f64,
    too_fast: u32,
}

impl BrakingWatch {
    /// For a ramp of `deceleration_rad_s2` at the handle, whose angle is measured in steps of `resolution_rad`. The target moved at
    /// `speed_rad_s` when the quick stop was sent.
    pub fn new(deceleration_rad_s2: f64, resolution_rad: f64, period_s: f64, speed_rad_s: f64) -> Self {
        Self {
            deceleration_rad_s2,
            resolution_rad,
            period_s,
            periods: 0,
            seen: 0,
            before: None,
            begun_rad_s: speed_rad_s.abs(),
            too_fast: 0,
        }
    }

    /// A period without new readings.
    pub fn skip(&mut self) {
        self.periods += 1;
    }

    /// The handle's angle in a period, and whether the drive's state is that of a quick stop, or a later one.
    ///
    /// # Errors
    /// [`CanFault::QuickStopIgnored`] or [`CanFault::NotBraking`].
    pub fn observe(&mut self, angle_rad: f64, is_stopping: bool) -> Result<(), CanFault> {
        self.periods += 1;
        self.seen += 1;
        if !is_stopping && self.seen >= PERIODS_TO_OBEY {
            return Err(CanFault::QuickStopIgnored { periods: self.seen });
        }
        let Some((before_rad, then)) = self.before.replace((angle_rad, self.periods)) else { return Ok(()) };
        let elapsed_s = f64::from(self.periods - then) * self.period_s;
        let measured_rad_s = (angle_rad - before_rad).abs() / elapsed_s;
        if self.periods <= PERIODS_TO_OBEY {
            self.begun_rad_s = self.begun_rad_s.max(measured_rad_s);
            return Ok(());
        }
        // The measured speed is that of the middle of the time between the readings.
        let braked_s = f64::from(self.periods - PERIODS_TO_OBEY) * self.period_s - 0.5 * elapsed_s;
        let slower_rad_s = BRAKING_PART * self.deceleration_rad_s2 * braked_s.max(0.0);
        let limit_rad_s =
            (self.begun_rad_s - slower_rad_s).max(SETTLING_RAD_S) + 2.0 * self.resolution_rad / elapsed_s;
        self.too_fast = if measured_rad_s > limit_rad_s { self.too_fast + 1 } else { 0 };
        if self.too_fast < NOT_BRAKING_PERIODS {
            return Ok(());
        }
        Err(CanFault::NotBraking { measured_rad_s, limit_rad_s })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_S: f64 = 0.002;
    const SPEED_RAD_S: f64 = 2.6;

    /// Periods until a fault is found in a handle that decelerates so from 2.6 rad/s, one period after it was told to.
    fn found_with(deceleration_rad_s2: f64, stops_after: u32) -> Option<(u32, CanFault)> {
        let mut watch = BrakingWatch::new(60.0, 5e-5, PERIOD_S, SPEED_RAD_S);
        let (mut angle_rad, mut speed_rad_s) = (0.1, SPEED_RAD_S);
        (1..=60).find_map(|period| {
            angle_rad += speed_rad_s * PERIOD_S;
            if period > 1 {
                speed_rad_s = (speed_rad_s - deceleration_rad_s2 * PERIOD_S).max(0.0);
            }
            watch.observe(angle_rad, period >= stops_after).err().map(|fault| (period, fault))
        })
    }

    #[test]
    fn drive_that_brakes_on_its_ramp_or_harder_passes() {
        for deceleration_rad_s2 in [50.0, 60.0, 500.0] {
            assert_eq!(found_with(deceleration_rad_s2, 2), None, "{deceleration_rad_s2}");
        }
    }

    #[test]
    fn drive_that_does_not_leave_its_state_is_found_in_three_periods_and_one_that_does_not_slow_down_soon_after()
     {
        assert_eq!(found_with(60.0, 100), Some((3, CanFault::QuickStopIgnored { periods: 3 })));
        let (period, fault) = found_with(0.0, 2).unwrap();
        assert!(matches!(fault, CanFault::NotBraking { .. }) && period <= 8, "{period}: {fault}");
    }

    #[test]
    fn handle_that_a_hand_moves_slowly_is_no_fault() {
        let mut watch = BrakingWatch::new(60.0, 5e-5, PERIOD_S, 0.0);
        for period in 1..=60 {
            watch.observe(0.15 * PERIOD_S * f64::from(period), true).unwrap();
        }
    }

    #[test]
    fn periods_without_readings_tell_nothing_about_the_state() {
        let mut watch = BrakingWatch::new(60.0, 5e-5, PERIOD_S, 0.0);
        (0..10).for_each(|_| watch.skip());
        assert_eq!(watch.observe(0.1, false), Ok(()));
    }
}
