//! Times of arrival on the monotonic clock: from the kernel's stamps, which are times of day, or from when a frame was read.
//!
//! A time of day may be set while frames wait. So a stamp is only believed as far as the monotonic clock agrees: a frame
//! came after the socket was last seen empty, and before it was read.

use std::time::{Duration, Instant, SystemTime};

use super::can_bus::Arrival;

/// A change of the two clocks against each other that is no rate correction, but a clock that was set.
const CLOCK_STEP: Duration = Duration::from_millis(1);

/// Turns stamps of the kernel into times of the monotonic clock.
#[derive(Debug, Clone, Copy)]
pub struct ArrivalClock {
    /// When the socket was last seen empty: whatever is read later arrived later.
    empty_at: Instant,
    /// Both clocks, read at the same time.
    pair: (Instant, SystemTime),
}

impl ArrivalClock {
    /// At the opening of a socket, with both clocks read then.
    pub fn new(now: Instant, wall: SystemTime) -> Self {
        Self { empty_at: now, pair: (now, wall) }
    }

    /// Nothing was waiting at `now`.
    pub fn drained(&mut self, now: Instant) {
        self.empty_at = now;
    }

    /// When a frame arrived that was read at `now`, when the time of day was `wall`. If the time of day was set since the
    /// frame before, the frame counts as old as it can be.
    pub fn arrival(&mut self, stamp: SystemTime, now: Instant, wall: SystemTime) -> Instant {
        let elapsed = now.saturating_duration_since(self.pair.0);
        let was_set = difference(self.pair.1 + elapsed, wall) > CLOCK_STEP + elapsed / 1000;
        self.pair = (now, wall);
        let longest = now.saturating_duration_since(self.empty_at);
        let age = match wall.duration_since(stamp) {
            Ok(age) if !was_set => age.min(longest),
            // Stamped in the future: within the rounding of the two readings it has just arrived.
            Err(ahead) if !was_set && ahead.duration() < CLOCK_STEP => Duration::ZERO,
            _ => longest,
        };
        now - age
    }
}

/// Times of arrival at an adapter without stamps, which tells only when a frame was read.
#[derive(Debug, Clone, Copy)]
pub struct ReadClock {
    /// When the adapter was last asked for all that it had: whatever is read later arrived later.
    empty_at: Instant,
}

impl ReadClock {
    /// At the opening of an adapter.
    pub fn new(now: Instant) -> Self {
        Self { empty_at: now }
    }

    /// The adapter was asked at `asked`, and had nothing.
    pub fn drained(&mut self, asked: Instant) {
        self.empty_at = asked;
    }

    /// When what was just read arrived, from an adapter that was asked for it at `asked`. `is_all` says whether there was room for more.
    pub fn read(&mut self, asked: Instant, is_all: bool) -> Arrival {
        let arrival = Arrival { earliest: self.empty_at, latest: Instant::now() };
        if is_all {
            self.drained(asked);
        }
        arrival
    }
}

fn difference(one: SystemTime, other: SystemTime) -> Duration {
    one.duration_since(other).unwrap_or_else(|error| error.duration())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: Duration = Duration::from_millis(1);

    #[test]
    fn a_stamp_is_an_age_before_the_reading() {
        let (start, wall) = (Instant::now(), SystemTime::now());
        let mut arrivals = ArrivalClock::new(start, wall);
        assert_eq!(arrivals.arrival(wall + 3 * MS, start + 5 * MS, wall + 5 * MS), start + 3 * MS);
    }

    #[test]
    fn a_time_of_day_that_is_set_makes_no_frame_older_than_the_socket_was_empty_nor_newer_than_now() {
        let hour = Duration::from_secs(3600);
        for (stamp, read) in [
            // Set forward and backward while the frame waited.
            (3 * MS, hour + 5 * MS),
            (hour + 3 * MS, 5 * MS),
            // Set before the frame came.
            (hour + 3 * MS, hour + 5 * MS),
        ] {
            let (start, wall) = (Instant::now(), SystemTime::now());
            let mut arrivals = ArrivalClock::new(start, wall);
            arrivals.drained(start + 2 * MS);
            let arrived = arrivals.arrival(wall + stamp, start + 5 * MS, wall + read);
            assert_eq!(arrived, start + 2 * MS, "stamped at {stamp:?}, read at {read:?}");
        }
    }

    #[test]
    fn after_the_time_of_day_was_set_the_next_stamps_are_right_again() {
        let (start, wall) = (Instant::now(), SystemTime::now() + Duration::from_secs(60));
        let mut arrivals = ArrivalClock::new(start, wall - Duration::from_secs(60));
        arrivals.arrival(wall, start, wall);
        arrivals.drained(start);
        assert_eq!(arrivals.arrival(wall + 9 * MS, start + 10 * MS, wall + 10 * MS), start + 9 * MS);
    }
}
