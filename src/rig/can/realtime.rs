//! What the operating system can grant a cycle that must not be late: priority, a core of its own, memory that stays.

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
pub fn request() -> Privileges {
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
pub fn request() -> Privileges {
    let not_here = || Err("only on Linux".to_owned());
    Privileges { realtime_priority: not_here(), memory_locked: not_here(), pinned: not_here() }
}
