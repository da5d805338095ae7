//! Time on the core, which other work on the machine does not lengthen, beside time by the clock; and memory.

use std::time::{Duration, Instant};

/// A measured time.
#[derive(Debug, Clone, Copy)]
pub struct Seconds {
    /// Time that the threads at work were on a core, all together; by the clock where the system does not say.
    pub on_core_s: f64,
    /// Time by the clock.
    pub clock_s: f64,
}

impl Seconds {
    /// A part of it.
    pub fn divided_by(self, parts: f64) -> Self {
        Self { on_core_s: self.on_core_s / parts, clock_s: self.clock_s / parts }
    }
}

/// Shortest and longest measurement of one figure, and fewest repeats.
const LEAST: Duration = Duration::from_millis(150);
const FEWEST: usize = 5;

/// The best of several times that `work` takes.
pub fn best(mut work: impl FnMut()) -> Seconds {
    let begun = Instant::now();
    let mut best = Seconds { on_core_s: f64::INFINITY, clock_s: f64::INFINITY };
    let mut repeats = 0;
    while repeats < FEWEST || begun.elapsed() < LEAST {
        let seconds = once(&mut work);
        best.on_core_s = best.on_core_s.min(seconds.on_core_s);
        best.clock_s = best.clock_s.min(seconds.clock_s);
        repeats += 1;
    }
    best
}

/// The time that `work` takes, on all threads of the process together.
pub fn once(work: impl FnOnce()) -> Seconds {
    let (clock, before) = (Instant::now(), process_s());
    work();
    let clock_s = clock.elapsed().as_secs_f64();
    Seconds { on_core_s: process_s().zip(before).map_or(clock_s, |(now, before)| now - before), clock_s }
}

/// Runs `work` where the parallel parts of the library have so many threads.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads can be had").install(work)
}

#[cfg(unix)]
fn process_s() -> Option<f64> {
    let now = rustix::time::clock_gettime(rustix::time::ClockId::ProcessCPUTime);
    Some(now.tv_sec as f64 + now.tv_nsec as f64 * 1e-9)
}

#[cfg(not(unix))]
fn process_s() -> Option<f64> {
    None
}

/// The most memory that the process ever held; `None` where the system does not say.
pub fn peak_bytes() -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kilobytes| 1024 * kilobytes)
}
