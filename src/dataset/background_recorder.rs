//! A thread that writes, behind a ring, so that a slow disk never delays the loop. The loop's end asks for no memory and waits
//! for no lock; its only call to the operating system wakes the thread when there is something for the journal.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rtrb::{Consumer, Producer, PushError, RingBuffer};

use super::audit::AuditEntry;
use super::recorder::{RecordError, Recorder, Step};
use crate::session::{Input, Machine, Output, Recorder as KeepsSession};

/// Steps that the ring holds: 26 s at 2.5 kHz.
const ROOM: usize = 1 << 16;
/// How often the thread looks when there is nothing to do.
const IDLE: Duration = Duration::from_millis(2);
/// How long a loop that has time waits before it looks again.
const A_MOMENT: Duration = Duration::from_micros(20);

/// A [`Recorder`] at work on a thread of its own.
#[derive(Debug)]
pub struct BackgroundRecorder {
    ring: Producer<Step>,
    thread: Option<JoinHandle<Result<(), RecordError>>>,
    /// Journal entries handed over.
    told: u64,
    /// The loop has time: it waits for the disk rather than fail.
    is_patient: bool,
    remarks: AuditSender,
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    /// Journal entries on disk.
    safe: AtomicU64,
    /// No more steps will come.
    over: AtomicBool,
    /// The thread has given up.
    failed: AtomicBool,
}

/// Where others than the loop hand in what was done at a console.
#[derive(Debug, Clone)]
pub struct AuditSender(mpsc::Sender<AuditEntry>);

impl AuditSender {
    /// Has it written into the journal; whether anybody still writes one.
    pub fn send(&self, remark: AuditEntry) -> bool {
        self.0.send(remark).is_ok()
    }
}

impl BackgroundRecorder {
    /// Takes a recorder to a thread of its own.
    pub fn start(recorder: Recorder) -> Self {
        let (ring, steps) = RingBuffer::new(ROOM);
        let (remarks, remarked) = mpsc::channel();
        let shared = Arc::new(Shared::default());
        let thread = thread::spawn({
            let shared = shared.clone();
            move || {
                // Also when it panics.
                let _failed = FailedUnlessOver(&shared);
                write(recorder, steps, &remarked, &shared)
            }
        });
        Self { ring, thread: Some(thread), told: 0, is_patient: false, remarks: AuditSender(remarks), shared }
    }

    /// The same for a loop without deadlines: it waits until what happened is on disk, as with the recorder itself.
    pub fn patient(recorder: Recorder) -> Self {
        let mut started = Self::start(recorder);
        started.is_patient = true;
        started
    }

    /// Where others than the loop hand in what was done at a console.
    pub fn remarks(&self) -> AuditSender {
        self.remarks.clone()
    }

    fn wake(&self) {
        self.thread.iter().for_each(|thread| thread.thread().unpark());
    }

    /// Waits for room, or for the disk.
    fn wait_while(&mut self, goes_on: impl Fn(&Self) -> bool) -> Result<(), RecordError> {
        while goes_on(self) {
            if self.shared.failed.load(Ordering::Acquire) {
                return self.join().and(Err(RecordError::WriterGone));
            }
            self.wake();
            thread::sleep(A_MOMENT);
        }
        Ok(())
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// What could not be written.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.join()
    }

    fn join(&mut self) -> Result<(), RecordError> {
        self.shared.over.store(true, Ordering::Release);
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            _ => Err(RecordError::WriterGone),
        }
    }
}

struct FailedUnlessOver<'a>(&'a Shared);

impl Drop for FailedUnlessOver<'_> {
    fn drop(&mut self) {
        if !self.0.over.load(Ordering::Acquire) {
            self.0.failed.store(true, Ordering::Release);
        }
    }
}

fn write(
    mut recorder: Recorder,
    mut steps: Consumer<Step>,
    remarks: &mpsc::Receiver<AuditEntry>,
    shared: &Shared,
) -> Result<(), RecordError> {
    loop {
        // Asked before looking, so that what came just before the end is still seen.
        let over = shared.over.load(Ordering::Acquire);
        match steps.pop() {
            Ok(step) => {
                recorder.keep_step(&step)?;
                if step.is_told() {
                    shared.safe.fetch_add(1, Ordering::Release);
                }
            }
            Err(_) => match remarks.try_recv() {
                Ok(remark) => recorder.keep_remark(remark)?,
                Err(_) if over => return Ok(()),
                Err(_) => thread::park_timeout(IDLE),
            },
        }
    }
}

impl KeepsSession for BackgroundRecorder {
    type Error = RecordError;

    fn on_disk(&self) -> bool {
        self.shared.safe.load(Ordering::Acquire) == self.told
    }

    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), RecordError> {
        if self.shared.failed.load(Ordering::Acquire) {
            return self.join().and(Err(RecordError::WriterGone));
        }
        let step = Step::new(input, output, machine);
        if !step.is_kept() {
            return Ok(());
        }
        if self.is_patient {
            self.wait_while(|own| own.ring.is_full())?;
        }
        self.ring.push(step).map_err(|PushError::Full(_)| RecordError::TooSlow { waiting: ROOM })?;
        if step.is_told() {
            self.told += 1;
            // The ramp waits for the journal, so nobody should sleep over it.
            self.wake();
        }
        if self.is_patient { self.wait_while(|own| !own.on_disk()) } else { Ok(()) }
    }
}

impl Drop for BackgroundRecorder {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Release);
    }
}
