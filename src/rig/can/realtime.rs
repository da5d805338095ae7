//! What the operating system can do for a cycle that must not be late: absolute wake-ups, priority, memory that stays.

use std::time::{Duration, Instant};

use serde::{Serialize, Serializer};

/// What was asked of the system and granted or not; the session keeps it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Privileges {
    /// The thread runs under SCHED_FIFO, before all ordinary ones.
    #[serde(serialize_with = "in_words")]
    pub realtime_priority: Result<(), String>,
    /// All memory of the program stays in memory.
    #[serde(serialize_with = "in_words")]
    pub memory_locked: Result<(), String>,
    /// The thread stays on one core.
    #[serde(serialize_with = "in_words")]
    pub pinned: Result<(), String>,
}

fn in_words<S: Serializer>(granted: &Result<(), String>, serializer: S) -> Result<S::Ok, S::Error> {
    match granted {
        Ok(()) => serializer.serialize_str("granted"),
        Err(why) => serializer.collect_str(&format_args!("refused: {why}")),
    }
}

/// Priority of the cycle: above ordinary programs, below the kernel's own threads for interrupts (50).
#[cfg(target_os = "linux")]
const PRIORITY: i32 = 49;

/// Asks for everything for the thread that runs the cycle.
#[cfg(target_os = "linux")]
pub fn ask() -> Privileges {
    use rustix::mm::{MlockAllFlags, mlockall};
    use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

    let parameters = libc::sched_param { sched_priority: PRIORITY };
    // SAFETY: the parameters live for the call; 0 is the calling thread.
    let granted = unsafe { libc::sched_setscheduler(0, libc::SCHED_FIFO, &raw const parameters) } == 0;
    let realtime_priority = if granted { Ok(()) } else { Err(std::io::Error::last_os_error().to_string()) };
    // Pinned only with priority: without it, a busy core could not be left.
    let pinned = match (granted, sched_getaffinity(None)) {
        (true, Ok(allowed)) => {
            let last = (0..CpuSet::MAX_CPU).rev().find(|cpu| allowed.is_set(*cpu));
            let mut one = CpuSet::new();
            last.into_iter().for_each(|cpu| one.set(cpu));
            sched_setaffinity(None, &one).map_err(|error| error.to_string())
        }
        (false, _) => Err("only with real-time priority".to_owned()),
        (true, Err(error)) => Err(error.to_string()),
    };
    let memory_locked =
        mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| error.to_string());
    Privileges { realtime_priority, memory_locked, pinned }
}

/// Other systems have no such calls here.
#[cfg(not(target_os = "linux"))]
pub fn ask() -> Privileges {
    let not_here = || Err("only on Linux".to_owned());
    Privileges { realtime_priority: not_here(), memory_locked: not_here(), pinned: not_here() }
}

/// Wakes up at points in time that lie on a grid, however long the work between took.
#[derive(Debug)]
pub struct Metronome {
    period: Duration,
    /// The grid's origin on both clocks, and the next point's number.
    origin: Instant,
    #[cfg(target_os = "linux")]
    origin_monotonic: rustix::time::Timespec,
    next: u64,
}

impl Metronome {
    /// A grid that begins one period from now.
    pub fn new(period: Duration) -> Self {
        Self {
            period,
            origin: Instant::now(),
            #[cfg(target_os = "linux")]
            origin_monotonic: rustix::time::clock_gettime(rustix::time::ClockId::Monotonic),
            next: 1,
        }
    }

    /// Time from one point to the next.
    pub fn period(&self) -> Duration {
        self.period
    }

    /// The point that [`Self::wait`] wakes up at.
    pub fn next(&self) -> Instant {
        self.origin + self.after_origin()
    }

    fn after_origin(&self) -> Duration {
        Duration::from_nanos((self.period.as_nanos() as u64).saturating_mul(self.next))
    }

    /// Sleeps until the next point; how late it woke up.
    pub fn wait(&mut self) -> Duration {
        let due = self.next();
        self.sleep_until(due);
        self.next += 1;
        due.elapsed()
    }

    #[cfg(target_os = "linux")]
    fn sleep_until(&self, due: Instant) {
        use rustix::thread::{ClockId, clock_nanosleep_absolute};
        use rustix::time::Timespec;

        let after = self.after_origin();
        let nanoseconds = self.origin_monotonic.tv_nsec + i64::from(after.subsec_nanos());
        let at = Timespec {
            tv_sec: self.origin_monotonic.tv_sec + after.as_secs() as i64 + nanoseconds / 1_000_000_000,
            tv_nsec: nanoseconds % 1_000_000_000,
        };
        // A signal may wake it up early; a system that refuses to sleep is left to the deadline check.
        while Instant::now() < due && clock_nanosleep_absolute(ClockId::Monotonic, &at).is_ok() {}
    }

    #[cfg(not(target_os = "linux"))]
    fn sleep_until(&self, due: Instant) {
        std::thread::sleep(due.saturating_duration_since(Instant::now()));
    }

    /// Leaves out the points that have passed; how many.
    pub fn catch_up(&mut self) -> u64 {
        let passed = (self.origin.elapsed().as_nanos() / self.period.as_nanos().max(1)) as u64;
        let left_out = (passed + 1).saturating_sub(self.next);
        self.next += left_out;
        left_out
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_lie_on_the_grid_whatever_happens_between() {
        let period = Duration::from_millis(2);
        let mut metronome = Metronome::new(period);
        let first = metronome.next();
        for number in 0..5u32 {
            assert_eq!(metronome.next(), first + period * number);
            metronome.wait();
            assert!(Instant::now() >= first + period * number);
        }
        std::thread::sleep(period * 4);
        let left_out = metronome.catch_up();
        assert!(left_out >= 3, "{left_out}");
        assert!(metronome.next() > Instant::now() - period);
        assert_eq!((metronome.next() - first).as_nanos() % period.as_nanos(), 0);
    }
}
