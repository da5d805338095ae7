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

/// The privileges of the thread that asked for them. They are given back when this is dropped, which must happen on the same
/// thread: threads that it starts later would inherit them.
#[derive(Debug)]
pub struct RealTimeThread {
    privileges: Privileges,
    #[cfg(target_os = "linux")]
    before: ThreadBefore,
}

/// How the thread was scheduled before it asked.
#[cfg(target_os = "linux")]
#[derive(Debug)]
struct ThreadBefore {
    policy: i32,
    priority: i32,
    cores: Option<rustix::thread::CpuSet>,
}

impl RealTimeThread {
    /// What was granted.
    pub fn privileges(&self) -> &Privileges {
        &self.privileges
    }
}

#[cfg(target_os = "linux")]
impl RealTimeThread {
    /// Asks for everything for the thread that runs the cycle.
    pub fn request() -> Self {
        use rustix::mm::{MlockAllFlags, mlockall};
        use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

        let mut parameters = libc::sched_param { sched_priority: 0 };
        // SAFETY: the parameters live for both calls; 0 is the calling thread.
        let policy = unsafe {
            libc::sched_getparam(0, &raw mut parameters);
            libc::sched_getscheduler(0)
        };
        let cores = sched_getaffinity(None);
        let before = ThreadBefore {
            policy: policy.max(libc::SCHED_OTHER),
            priority: parameters.sched_priority,
            cores: cores.as_ref().ok().copied(),
        };
        let realtime_priority = set_scheduler(libc::SCHED_FIFO, PRIORITY);
        // Pinned only with priority: without it, a busy core could not be left.
        let pinned = match (&realtime_priority, cores) {
            (Ok(()), Ok(allowed)) => {
                let last = (0..CpuSet::MAX_CPU).rev().find(|cpu| allowed.is_set(*cpu));
                let mut one = CpuSet::new();
                last.into_iter().for_each(|cpu| one.set(cpu));
                sched_setaffinity(None, &one).map_err(|error| error.to_string())
            }
            (Err(_), _) => Err("only with real-time priority".to_owned()),
            (Ok(()), Err(error)) => Err(error.to_string()),
        };
        let memory_locked =
            mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| error.to_string());
        Self { privileges: Privileges { realtime_priority, memory_locked, pinned }, before }
    }
}

/// Sets policy and priority of the calling thread.
#[cfg(target_os = "linux")]
fn set_scheduler(policy: i32, priority: i32) -> Result<(), String> {
    let parameters = libc::sched_param { sched_priority: priority };
    // SAFETY: the parameters live for the call; 0 is the calling thread.
    let is_set = unsafe { libc::sched_setscheduler(0, policy, &raw const parameters) } == 0;
    if is_set { Ok(()) } else { Err(std::io::Error::last_os_error().to_string()) }
}

#[cfg(target_os = "linux")]
impl Drop for RealTimeThread {
    /// Gives everything back that was granted. What is refused is only told: the session's data are safe either way.
    fn drop(&mut self) {
        let Self { privileges, before } = self;
        let mut refused = Vec::new();
        if privileges.pinned.is_ok()
            && let Some(cores) = &before.cores
        {
            refused
                .extend(rustix::thread::sched_setaffinity(None, cores).err().map(|error| error.to_string()));
        }
        if privileges.realtime_priority.is_ok() {
            refused.extend(set_scheduler(before.policy, before.priority).err());
        }
        if privileges.memory_locked.is_ok() {
            refused.extend(rustix::mm::munlockall().err().map(|error| error.to_string()));
        }
        for why in refused {
            tracing::warn!("a real-time privilege could not be given back: {why}");
        }
    }
}

/// Other systems have no such calls here.
#[cfg(not(target_os = "linux"))]
impl RealTimeThread {
    /// Asks for nothing.
    pub fn request() -> Self {
        let not_here = || Err("only on Linux".to_owned());
        Self {
            privileges: Privileges {
                realtime_priority: not_here(),
                memory_locked: not_here(),
                pinned: not_here(),
            },
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use std::fs;

    use super::*;

    /// Policy and priority, cores, and locked memory (kB), as the system says.
    fn asked() -> (i32, i32, String, u64) {
        let mut parameters = libc::sched_param { sched_priority: -1 };
        // SAFETY: the parameters live for both calls.
        let policy = unsafe {
            libc::sched_getparam(0, &raw mut parameters);
            libc::sched_getscheduler(0)
        };
        let status = fs::read_to_string("/proc/thread-self/status").unwrap();
        let line = |name: &str| {
            let line = status.lines().find(|line| line.starts_with(name)).unwrap();
            line[name.len()..].trim().to_owned()
        };
        let locked = line("VmLck:").trim_end_matches(" kB").parse().unwrap();
        (policy, parameters.sched_priority, line("Cpus_allowed_list:"), locked)
    }

    #[test]
    fn what_the_cycle_was_granted_is_given_back() {
        let before = asked();
        let held = RealTimeThread::request();
        let (policy, priority, cores, locked_kb) = asked();
        let Privileges { realtime_priority, memory_locked, pinned } = held.privileges().clone();
        match &realtime_priority {
            Ok(()) => assert_eq!((policy, priority), (libc::SCHED_FIFO, PRIORITY)),
            Err(why) => eprintln!("NOT TESTED: this system grants no real-time priority: {why}"),
        }
        match &pinned {
            Ok(()) => assert!(cores.parse::<u32>().is_ok(), "one core, not {cores}"),
            Err(why) => eprintln!("NOT TESTED: this system grants no core: {why}"),
        }
        match &memory_locked {
            Ok(()) => assert!(locked_kb > 0),
            Err(why) => eprintln!("NOT TESTED: this system locks no memory: {why}"),
        }
        drop(held);
        assert_eq!(asked(), before);
    }
}
