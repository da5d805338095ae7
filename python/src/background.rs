//! Work on threads of the crate's own while Python goes on: the lock of the interpreter is released, and Ctrl-C is heard.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex};
use std::time::Duration;

use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::errors::failed_work;

/// How often Python is asked whether the user interrupts.
const POLL: Duration = Duration::from_millis(20);

/// Stack of a worker, as large as that of the program's main thread.
const STACK_BYTES: usize = 8 << 20;

/// The workers, and the process that they belong to: a process that was forked has none of its parent's threads.
static POOL: Mutex<Option<(u32, Arc<ThreadPool>)>> = Mutex::new(None);

fn pool() -> PyResult<Arc<ThreadPool>> {
    let mut pool = POOL.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
    let process = std::process::id();
    if let Some((owner, pool)) = pool.as_ref()
        && *owner == process
    {
        return Ok(pool.clone());
    }
    let new = ThreadPoolBuilder::new()
        .stack_size(STACK_BYTES)
        .build()
        .map_err(|error| failed_work(format!("no threads can be started: {error}")))?;
    let new = Arc::new(new);
    // The threads of the parent are not there to be joined.
    std::mem::forget(pool.replace((process, new.clone())));
    Ok(new)
}

/// Tells Python how far the work is, and learns from it whether to go on.
#[derive(Clone)]
pub struct Progress {
    told: Sender<Told>,
    interrupted: Arc<AtomicBool>,
}

enum Told {
    Stage(String),
    Done,
}

/// What work gave, or what it panicked with.
type Outcome<T> = Result<T, Box<dyn Any + Send>>;

/// What a thread unwinds with when its work is no longer wanted.
struct Interrupted;

impl Progress {
    /// Does not return if the user interrupted.
    pub fn check(&self) {
        if self.is_interrupted() {
            resume_unwind(Box::new(Interrupted));
        }
    }

    /// Tells what is done next. Does not return if the user interrupted.
    pub fn stage(&self, name: impl Into<String>) {
        self.check();
        let _ = self.told.send(Told::Stage(name.into()));
    }

    /// Whether the user interrupted.
    pub fn is_interrupted(&self) -> bool {
        self.interrupted.load(Ordering::Relaxed)
    }
}

/// Runs `work` on the crate's workers. Each stage that it tells is given to `listener`, a callable of Python.
///
/// # Errors
/// If the user interrupts (`KeyboardInterrupt`, at once; the work stops at its next stage), the listener raises, or the work panics.
pub fn run<T: Send + 'static>(
    py: Python<'_>,
    listener: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Progress) -> T + Send + 'static,
) -> PyResult<T> {
    let (told, hear) = channel();
    let progress = Progress { told, interrupted: Arc::default() };
    let result: Arc<Mutex<Option<Outcome<T>>>> = Arc::default();
    let (for_work, place) = (progress.clone(), result.clone());
    pool()?.spawn(move || {
        let done = catch_unwind(AssertUnwindSafe(|| work(&for_work)));
        *place.lock().unwrap_or_else(std::sync::PoisonError::into_inner) = Some(done);
        let _ = for_work.told.send(Told::Done);
    });
    let hear = Mutex::new(hear);
    let stop = |error| {
        progress.interrupted.store(true, Ordering::Relaxed);
        // These workers go on until the work hears of it; what comes next does not wait for them.
        drop(POOL.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take());
        Err(error)
    };
    loop {
        let next =
            py.detach(|| hear.lock().unwrap_or_else(std::sync::PoisonError::into_inner).recv_timeout(POLL));
        match next {
            Ok(Told::Stage(name)) => {
                if let Some(Err(error)) = listener.map(|listener| listener.call1((name,))) {
                    return stop(error);
                }
            }
            Ok(Told::Done) => break,
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => return Err(failed_work("a worker ended before its work")),
        }
        if let Err(error) = py.check_signals() {
            return stop(error);
        }
    }
    let done = result.lock().unwrap_or_else(std::sync::PoisonError::into_inner).take();
    match done {
        Some(Ok(value)) => Ok(value),
        Some(Err(panic)) => {
            let text = panic
                .downcast_ref::<&str>()
                .map(|text| (*text).to_owned())
                .or_else(|| panic.downcast_ref::<String>().cloned())
                .unwrap_or_else(|| "unknown".to_owned());
            Err(failed_work(format!("a mistake in ramphold itself, please report it: {text}")))
        }
        None => Err(failed_work("a worker ended before its work")),
    }
}
