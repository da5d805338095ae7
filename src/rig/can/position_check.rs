//! Whether a position that a motor reports can be where its shaft is, for motors whose frames carry no other proof.

use std::time::{Duration, Instant};

use super::bus::Arrival;
use super::fault::CanFault;
use crate::rig::Channel;

/// Part of the speed limit by which a shaft may be faster before its reading is not believed.
const SPEED_ALLOWANCE: f64 = 1.5;

/// Compares each reading with the last that was believed.
#[derive(Debug, Clone, Copy)]
pub struct PositionCheck {
    /// Highest believable speed of the handle, rad/s.
    speed_rad_s: f64,
    /// Steps of the encoder and of the field, rad at the handle.
    slack_rad: f64,
    /// Shortest time between two readings that is believed: their frames may arrive together.
    shortest: Duration,
    /// The latest reading that was believed, and the earliest time at which the shaft can have been there.
    believed: Option<(f64, Instant)>,
}

impl PositionCheck {
    /// Before the first reading.
    pub fn new(speed_limit_rad_s: f64, slack_rad: f64, shortest: Duration) -> Self {
        Self { speed_rad_s: speed_limit_rad_s * SPEED_ALLOWANCE, slack_rad, shortest, believed: None }
    }

    /// Forgets what was believed: the next reading is on another scale.
    pub fn restart(&mut self) {
        self.believed = None;
    }

    /// The latest reading that was believed, rad at the handle.
    pub fn angle_rad(&self) -> Option<f64> {
        self.believed.map(|(angle_rad, _)| angle_rad)
    }

    /// A reading of the handle's angle, and when its frame arrived. One that is not believed changes nothing.
    ///
    /// # Errors
    /// [`CanFault::NotANumber`] for one that is not finite; [`CanFault::PositionJump`] for one that no shaft within the
    /// speed limit can have reached.
    pub fn believe(&mut self, angle_rad: f64, arrival: Arrival) -> Result<(), CanFault> {
        if !angle_rad.is_finite() {
            return Err(CanFault::NotANumber { channel: Channel::Angle });
        }
        let mut earliest = arrival.earliest;
        if let Some((before_rad, since)) = self.believed {
            let time = arrival.latest.saturating_duration_since(since).max(self.shortest);
            let jump_rad = (angle_rad - before_rad).abs();
            let limit_rad = self.speed_rad_s * time.as_secs_f64() + self.slack_rad;
            if jump_rad > limit_rad {
                return Err(CanFault::PositionJump { jump_rad, limit_rad });
            }
            // Frames that were read together share the time in which they can have arrived.
            let needed_s = (jump_rad - self.slack_rad).max(0.0) / self.speed_rad_s;
            earliest = earliest.max(since + Duration::from_secs_f64(needed_s)).min(arrival.latest);
        }
        self.believed = Some((angle_rad, earliest));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reading_that_no_shaft_can_have_reached_is_not_believed_and_changes_nothing() {
        let start = Instant::now();
        let at = |ms: u64| Arrival::at(start + Duration::from_millis(ms));
        let mut check = PositionCheck::new(4.0, 0.001, Duration::from_millis(1));
        assert_eq!(check.believe(0.1, at(0)), Ok(()));
        assert_eq!(check.believe(0.104, at(1)), Ok(()));
        for wrong_rad in [0.354, -1.0, 1e30] {
            let refused = check.believe(wrong_rad, at(2));
            assert!(matches!(refused, Err(CanFault::PositionJump { .. })), "{wrong_rad}: {refused:?}");
        }
        for wrong_rad in [f64::NAN, f64::INFINITY] {
            let refused = check.believe(wrong_rad, at(2));
            assert_eq!(refused, Err(CanFault::NotANumber { channel: Channel::Angle }));
        }
        assert_eq!(check.angle_rad(), Some(0.104));
        assert_eq!(
            check.believe(0.108, at(2)),
            Ok(()),
            "the readings after it are compared with the last believed one"
        );
    }

    #[test]
    fn reading_that_was_read_late_may_be_as_old_as_the_read_before() {
        let start = Instant::now();
        let between = |earliest_ms: u64, latest_ms: u64| Arrival {
            earliest: start + Duration::from_millis(earliest_ms),
            latest: start + Duration::from_millis(latest_ms),
        };
        let mut check = PositionCheck::new(4.0, 0.001, Duration::from_millis(2));
        assert_eq!(check.believe(0.0, between(0, 10)), Ok(()));
        assert_eq!(check.believe(0.03, between(10, 12)), Ok(()), "12 ms at 6 rad/s, where 2 would not do");
        let mut check = PositionCheck::new(4.0, 0.001, Duration::from_millis(2));
        assert_eq!(check.believe(0.0, between(0, 0)), Ok(()));
        assert_eq!(
            check.believe(0.03, between(0, 10)),
            Ok(()),
            "nearly 5 ms, of 10 that three readings share"
        );
        assert!(check.believe(0.063, between(0, 10)).is_err(), "more than the rest");
        assert_eq!(check.believe(0.06, between(0, 10)), Ok(()));
        assert!(
            check.believe(0.074, between(0, 10)).is_err(),
            "the shortest time between two is all that is left"
        );
        assert_eq!(check.believe(0.072, between(0, 10)), Ok(()));
    }
}
