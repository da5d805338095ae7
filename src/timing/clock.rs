//! The clock of everything that waits: the system's, or a virtual one that moves only when it is told to.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

/// A monotonic clock, and a way to wait on it.
pub trait Clock: fmt::Debug + Send + Sync {
    /// The present time.
    fn now(&self) -> Instant;

    /// Waits until `due`; returns at once if it has passed. It may return a little late.
    fn sleep_until(&self, due: Instant);
}

/// The clock of the operating system.
#[derive(Debug)]
pub struct SystemClock {
    /// One moment on both clocks: that of [`Instant`], and the kernel's, which takes absolute wake-up times.
    #[cfg(target_os = "linux")]
    origin: (Instant, rustix::time::Timespec),
}

impl Default for SystemClock {
    fn default() -> Self {
        Self {
            #[cfg(target_os = "linux")]
            origin: (Instant::now(), rustix::time::clock_gettime(rustix::time::ClockId::Monotonic)),
        }
    }
}

impl Clock for SystemClock {
    fn now(&self) -> Instant {
        Instant::now()
    }

    #[cfg(target_os = "linux")]
    fn sleep_until(&self, due: Instant) {
        use rustix::io::Errno;
        use rustix::thread::{ClockId, clock_nanosleep_absolute};
        use rustix::time::Timespec;

        let (origin, kernel) = &self.origin;
        let after = due.saturating_duration_since(*origin);
        let nanoseconds = kernel.tv_nsec + i64::from(after.subsec_nanos());
        let at = Timespec {
            tv_sec: kernel.tv_sec + after.as_secs() as i64 + nanoseconds / 1_000_000_000,
            tv_nsec: nanoseconds % 1_000_000_000,
        };
        // A signal ends the sleep early, and the rest is slept: a period that is too short makes the motor too fast. If the
        // system refuses to sleep, the caller's deadline check notices.
        while Instant::now() < due {
            match clock_nanosleep_absolute(ClockId::Monotonic, &at) {
                Ok(()) | Err(Errno::INTR) => {}
                Err(_) => break,
            }
        }
    }

    #[cfg(not(target_os = "linux"))]
    fn sleep_until(&self, due: Instant) {
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }
}

/// A clock that stands still until someone waits on it or moves it on: hours pass in no time, always alike.
///
/// Clones share one time.
#[derive(Debug, Clone)]
pub struct VirtualClock {
    start: Instant,
    elapsed_ns: Arc<AtomicU64>,
}

impl Default for VirtualClock {
    fn default() -> Self {
        Self { start: Instant::now(), elapsed_ns: Arc::default() }
    }
}

impl VirtualClock {
    /// Time since the clock was made.
    pub fn elapsed(&self) -> Duration {
        Duration::from_nanos(self.elapsed_ns.load(Ordering::SeqCst))
    }

    /// Moves the clock on to `due`; a clock that is further already stays there.
    pub fn advance_to(&self, due: Instant) {
        let elapsed = due.saturating_duration_since(self.start).as_nanos() as u64;
        self.elapsed_ns.fetch_max(elapsed, Ordering::SeqCst);
    }

    /// Moves the clock on by a duration, as if the program had been kept from running.
    pub fn advance(&self, duration: Duration) {
        self.advance_to(self.now() + duration);
    }
}

impl Clock for VirtualClock {
    fn now(&self) -> Instant {
        self.start + self.elapsed()
    }

    fn sleep_until(&self, due: Instant) {
        self.advance_to(due);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn virtual_clock_moves_on_only_when_someone_waits_and_never_back() {
        let clock = VirtualClock::default();
        let (start, other) = (clock.now(), clock.clone());
        clock.sleep_until(start + Duration::from_secs(3600));
        assert_eq!(other.elapsed(), Duration::from_secs(3600));
        other.sleep_until(start + Duration::from_secs(60));
        assert_eq!(clock.now(), start + Duration::from_secs(3600));
        clock.advance(Duration::from_millis(5));
        assert_eq!(other.elapsed(), Duration::from_millis(3_600_005));
    }

    #[test]
    fn system_clock_does_not_wake_up_before_the_time() {
        let clock = SystemClock::default();
        let due = clock.now() + Duration::from_millis(3);
        clock.sleep_until(due);
        assert!(clock.now() >= due);
    }
}
