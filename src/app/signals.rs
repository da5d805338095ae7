//! Ctrl-C, the system's request to end, and a terminal that is gone.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use signal_hook::consts::{SIGINT, SIGTERM};

use super::Failure;

/// A flag that SIGINT, SIGTERM, SIGQUIT and SIGHUP set. SIGHUP comes when the terminal is closed or its connection is lost; it stays
/// ignored where whoever started the program ignores it (`nohup`).
pub fn stop_on_signals() -> Result<Arc<AtomicBool>, Failure> {
    let stop = Arc::new(AtomicBool::new(false));
    for signal in [SIGINT, SIGTERM].into_iter().chain(of_unix()) {
        signal_hook::flag::register(signal, stop.clone()).map_err(Failure::Signals)?;
    }
    Ok(stop)
}

/// Sets `stop` instead of suspending the program (Ctrl-Z): whoever moves a motor must not fall asleep.
#[cfg(unix)]
pub fn stop_when_suspended(stop: &Arc<AtomicBool>) -> Result<(), Failure> {
    signal_hook::flag::register(signal_hook::consts::SIGTSTP, Arc::clone(stop)).map_err(Failure::Signals)?;
    Ok(())
}

#[cfg(not(unix))]
pub fn stop_when_suspended(_: &Arc<AtomicBool>) -> Result<(), Failure> {
    Ok(())
}

#[cfg(unix)]
fn of_unix() -> impl Iterator<Item = i32> {
    use signal_hook::consts::{SIGHUP, SIGQUIT};
    [SIGQUIT].into_iter().chain((!is_ignored(SIGHUP)).then_some(SIGHUP))
}

#[cfg(not(unix))]
fn of_unix() -> impl Iterator<Item = i32> {
    std::iter::empty()
}

/// Whether the program was started with a signal ignored. Only Linux is asked; elsewhere no signal counts as ignored.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}
