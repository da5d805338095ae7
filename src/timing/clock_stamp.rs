//! One moment on the clocks of a computer.

use std::time::{SystemTime, UNIX_EPOCH};

use serde::{Deserialize, Serialize};

/// One moment on the clocks of this computer, all read together.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ClockStamp {
    /// UTC by the clock of the operating system, ns since 1970.
    pub utc_ns: i64,
    /// The clock that nobody sets, ns; its zero is that of the operating system and another after it began anew.
    pub monotonic_ns: i64,
    /// The clock of Lab Streaming Layer, s, where it runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub lsl_s: Option<f64>,
    /// How much later than the least late sample of the second before the program had it, ns; `None` in older journals.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub late_ns: Option<i64>,
    /// How long the reading took, ns: the clocks are together to half of it.
    pub read_within_ns: i64,
}

impl ClockStamp {
    /// This moment. `lsl_ahead_s` is how far the clock of Lab Streaming Layer is ahead of [`monotonic_ns`], s, where it runs.
    pub fn now(lsl_ahead_s: Option<f64>) -> Self {
        let (utc, monotonic_ns, read_within_ns) = beside_monotonic(SystemTime::now);
        let utc_ns = utc.duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64);
        let lsl_s = lsl_ahead_s.map(|ahead_s| monotonic_ns as f64 * 1e-9 + ahead_s);
        Self { utc_ns, monotonic_ns, lsl_s, late_ns: None, read_within_ns }
    }
}

/// Readings of which the shortest is taken.
const READINGS: usize = 3;

/// Another clock and the monotonic one at one moment, and how long the reading took, ns: the shortest of some, as a thread that is held up
/// between two clocks has them apart.
pub fn beside_monotonic<T>(read: impl Fn() -> T) -> (T, i64, i64) {
    let reading = || {
        let before = monotonic_ns();
        let other = read();
        let within_ns = monotonic_ns() - before;
        (other, before + within_ns / 2, within_ns)
    };
    (1..READINGS).map(|_| reading()).fold(reading(), |best, own| if own.2 < best.2 { own } else { best })
}

/// The clock of the operating system that nobody sets, ns.
#[cfg(unix)]
pub fn monotonic_ns() -> i64 {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// The clock of the operating system that nobody sets, ns since it was first read.
#[cfg(not(unix))]
pub fn monotonic_ns() -> i64 {
    static ORIGIN: std::sync::OnceLock<std::time::Instant> = std::sync::OnceLock::new();
    ORIGIN.get_or_init(std::time::Instant::now).elapsed().as_nanos() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_clocks_of_a_stamp_go_on_together() {
        let first = ClockStamp::now(Some(0.25));
        std::thread::sleep(std::time::Duration::from_millis(5));
        let second = ClockStamp::now(None);
        let [utc, monotonic] = [second.utc_ns - first.utc_ns, second.monotonic_ns - first.monotonic_ns];
        assert!(monotonic >= 5_000_000 && first.read_within_ns >= 0);
        let apart = first.read_within_ns + second.read_within_ns;
        assert!((utc - monotonic).abs() <= apart + 1_000_000, "{utc} and {monotonic} ns");
        assert_eq!(first.lsl_s, Some(first.monotonic_ns as f64 * 1e-9 + 0.25));
        assert_eq!(second.lsl_s, None);
    }
}
