//! A timer that wakes up at points in time on a fixed grid, however long the work between them took.

use std::time::{Duration, Instant};

use super::Clock;

/// Points in time, one period apart, and the next one of them.
#[derive(Debug, Clone)]
pub struct PeriodicTimer {
    period: Duration,
    origin: Instant,
    /// Number of the next point; the origin has number 0.
    next: u64,
}

impl PeriodicTimer {
    /// A grid whose first point is one period after `origin`. Periods shorter than a nanosecond are taken as one.
    pub fn new(period: Duration, origin: Instant) -> Self {
        Self { period: period.max(Duration::from_nanos(1)), origin, next: 1 }
    }

    /// Time from one point to the next.
    pub fn period(&self) -> Duration {
        self.period
    }

    /// The point at which [`Self::wait`] wakes up.
    pub fn next(&self) -> Instant {
        self.origin + Duration::from_nanos((self.period.as_nanos() as u64).saturating_mul(self.next))
    }

    /// Waits for the next point. Returns by how much the wake-up was late.
    pub fn wait(&mut self, clock: &dyn Clock) -> Duration {
        let due = self.next();
        clock.sleep_until(due);
        self.next += 1;
        clock.now().saturating_duration_since(due)
    }

    /// Skips the points before `now`. Returns how many were skipped.
    pub fn catch_up(&mut self, now: Instant) -> u64 {
        let passed = (now.saturating_duration_since(self.origin).as_nanos() / self.period.as_nanos()) as u64;
        let skipped = (passed + 1).saturating_sub(self.next);
        self.next += skipped;
        skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::timing::VirtualClock;

    #[test]
    fn points_lie_on_the_grid_whatever_happens_between() {
        let (clock, period) = (VirtualClock::default(), Duration::from_millis(2));
        let origin = clock.now();
        let mut timer = PeriodicTimer::new(period, origin);
        for number in 1..=5u32 {
            assert_eq!(timer.next(), origin + period * number);
            clock.advance(Duration::from_micros(300));
            assert_eq!(timer.wait(&clock), Duration::ZERO);
            assert_eq!(clock.now(), origin + period * number);
        }
        clock.advance(Duration::from_micros(9_500));
        assert_eq!(timer.wait(&clock), Duration::from_micros(7_500));
        assert_eq!(timer.catch_up(clock.now()), 3);
        assert_eq!(timer.next(), origin + period * 10);
    }
}
