//! Recorder on a thread of its own, behind a ring buffer, so that a slow disk never delays the control loop. The loop's
//! end allocates nothing and takes no lock; its only system call wakes the thread when there is a journal entry to write.

use std::fmt;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc;
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rtrb::{Consumer, Producer, PushError, RingBuffer};

use super::audit::AuditEntry;
use super::recorder::{RecordError, Recorder};
use crate::rig::Origin;
use crate::session::{Progress, Step, StepConsumer, TransitionDetail};
use crate::timing::{ClockStamp, SampleClock, monotonic_ns};

/// Number of steps that the ring holds: 26 s at 2.5 kHz.
const RING_CAPACITY: usize = 1 << 16;
/// Longest sleep of the writing thread while there is nothing to write.
const WRITER_SLEEP: Duration = Duration::from_millis(2);
/// Time that a loop without deadlines sleeps before it checks the disk again.
const DISK_POLL: Duration = Duration::from_micros(20);

/// A [`Recorder`] that writes on a thread of its own.
#[derive(Debug)]
pub struct BackgroundRecorder {
    ring: Producer<Step>,
    thread: Option<JoinHandle<Result<(), RecordError>>>,
    /// Number of journal entries handed to the thread.
    entries_sent: u64,
    /// The loop has no deadlines: it waits for the disk instead of failing.
    waits_for_disk: bool,
    actions: AuditSender,
    origins: mpsc::Sender<(Origin, u64)>,
    /// The clocks of a session in real time.
    clocks: Option<SampleStamps>,
    shared: Arc<SharedWriterState>,
}

#[derive(Debug, Default)]
struct SharedWriterState {
    /// Number of journal entries on disk.
    entries_on_disk: AtomicU64,
    /// No more steps will come.
    over: AtomicBool,
    /// The thread has stopped because of an error.
    failed: AtomicBool,
}

/// Sends operators' actions to the journal, from any thread but the control loop's.
#[derive(Debug, Clone)]
pub struct AuditSender(mpsc::Sender<AuditEntry>);

impl AuditSender {
    /// Sends an action to the journal; `false` if the journal is closed.
    pub fn send(&self, action: AuditEntry) -> bool {
        self.0.send(action).is_ok()
    }
}

impl BackgroundRecorder {
    /// Moves a recorder to a thread of its own. `progress` is the session's progress so far; the thread follows it
    /// from the steps that it receives.
    pub fn start(recorder: Recorder, progress: Progress) -> Self {
        let (ring, steps) = RingBuffer::new(RING_CAPACITY);
        let (actions, received) = mpsc::channel();
        let (origins, noted) = mpsc::channel();
        let shared = Arc::new(SharedWriterState::default());
        let thread = thread::spawn({
            let shared = shared.clone();
            move || {
                // Also set when the thread panics.
                let _failed = FailedUnlessOver(&shared);
                write(recorder, progress, steps, (&received, &noted), &shared)
            }
        });
        Self {
            ring,
            thread: Some(thread),
            entries_sent: 0,
            waits_for_disk: false,
            actions: AuditSender(actions),
            origins,
            clocks: None,
            shared,
        }
    }

    /// Keeps when the first sample of each stretch and of each trial was had. For a rig in real time: `lsl_ahead_s` tells how far the clock
    /// of Lab Streaming Layer is ahead of the monotonic one.
    pub fn with_clocks(
        mut self,
        sample_rate_hz: f64,
        lsl_ahead_s: impl Fn() -> Option<f64> + Send + 'static,
    ) -> Self {
        self.clocks = Some(SampleStamps {
            lsl_ahead_s: Box::new(lsl_ahead_s),
            was_measured: false,
            times: SampleClock::new(sample_rate_hz),
            origin_ns: monotonic_ns(),
        });
        self
    }

    /// As [`BackgroundRecorder::start`], for a loop without deadlines: each step waits until its journal entry is on disk.
    pub fn start_waiting(recorder: Recorder, progress: Progress) -> Self {
        let mut started = Self::start(recorder, progress);
        started.waits_for_disk = true;
        started
    }

    /// The sender of operators' actions to this recorder's journal.
    pub fn actions(&self) -> AuditSender {
        self.actions.clone()
    }

    fn wake(&self) {
        self.thread.iter().for_each(|thread| thread.thread().unpark());
    }

    fn wait_while(&mut self, condition: impl Fn(&Self) -> bool) -> Result<(), RecordError> {
        while condition(self) {
            if self.shared.failed.load(Ordering::Acquire) {
                return self.join().and(Err(RecordError::WriterGone));
            }
            self.wake();
            thread::sleep(DISK_POLL);
        }
        Ok(())
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// The first error of the writing thread.
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

/// Chooses the samples whose times are kept.
struct SampleStamps {
    lsl_ahead_s: Box<dyn Fn() -> Option<f64> + Send>,
    was_measured: bool,
    /// Times of the samples from when they were had, s after `origin_ns`.
    times: SampleClock,
    origin_ns: i64,
}

impl fmt::Debug for SampleStamps {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter
            .debug_struct("SampleStamps")
            .field("was_measured", &self.was_measured)
            .finish_non_exhaustive()
    }
}

impl SampleStamps {
    /// The stamp of a step, which must have been made just now.
    fn of(&mut self, step: &Step) -> Option<ClockStamp> {
        let is_first = step.measured.is_some() && !self.was_measured;
        self.was_measured = step.measured.is_some();
        let detail = step.transition.and_then(|transition| transition.detail);
        let begins = step.measured.is_some() && matches!(detail, Some(TransitionDetail::Began { .. }));
        step.measured?;
        let stamp = (is_first || begins).then(|| ClockStamp::now((self.lsl_ahead_s)()));
        // How late the sample was had is counted to the stamp itself: the thread may be held up before it.
        let had_ns = stamp.map_or_else(monotonic_ns, |stamp| stamp.monotonic_ns);
        let had_s = (had_ns - self.origin_ns) as f64 * 1e-9;
        let late_s = had_s - self.times.time_s(step.sample, had_s);
        stamp.map(|stamp| ClockStamp { late_ns: Some((late_s * 1e9) as i64), ..stamp })
    }
}

struct FailedUnlessOver<'a>(&'a SharedWriterState);

impl Drop for FailedUnlessOver<'_> {
    fn drop(&mut self) {
        if !self.0.over.load(Ordering::Acquire) {
            self.0.failed.store(true, Ordering::Release);
        }
    }
}

fn write(
    mut recorder: Recorder,
    mut progress: Progress,
    mut steps: Consumer<Step>,
    (actions, origins): (&mpsc::Receiver<AuditEntry>, &mpsc::Receiver<(Origin, u64)>),
    shared: &SharedWriterState,
) -> Result<(), RecordError> {
    loop {
        // Read before the ring is emptied, so that the last steps are still written.
        let over = shared.over.load(Ordering::Acquire);
        // An origin is noted before the first step with the rig that has it.
        while let Ok((origin, sample)) = origins.try_recv() {
            recorder.note_origin(origin, sample)?;
            shared.entries_on_disk.fetch_add(1, Ordering::Release);
        }
        match steps.pop() {
            Ok(step) => {
                if let Some(transition) = &step.transition {
                    progress.apply(transition);
                }
                recorder.consume(&step, &progress)?;
                if step.is_journaled() {
                    shared.entries_on_disk.fetch_add(1, Ordering::Release);
                }
            }
            Err(_) => match actions.try_recv() {
                Ok(action) => recorder.record_action(action)?,
                Err(_) if over => return recorder.settle(),
                Err(_) => thread::park_timeout(WRITER_SLEEP),
            },
        }
    }
}

impl StepConsumer for BackgroundRecorder {
    type Error = RecordError;

    fn is_on_disk(&self) -> bool {
        self.shared.entries_on_disk.load(Ordering::Acquire) == self.entries_sent
    }

    fn note_origin(&mut self, origin: Origin, sample: u64) -> Result<(), RecordError> {
        self.origins.send((origin, sample)).map_err(|_| RecordError::WriterGone)?;
        self.entries_sent += 1;
        self.wake();
        Ok(())
    }

    fn consume(&mut self, step: &Step, _: &Progress) -> Result<(), RecordError> {
        if self.shared.failed.load(Ordering::Acquire) {
            return self.join().and(Err(RecordError::WriterGone));
        }
        let mut step = *step;
        step.clock = self.clocks.as_mut().and_then(|clocks| clocks.of(&step));
        if !step.is_recorded() {
            return Ok(());
        }
        if self.waits_for_disk {
            self.wait_while(|own| own.ring.is_full())?;
        }
        self.ring.push(step).map_err(|PushError::Full(_)| RecordError::TooSlow { waiting: RING_CAPACITY })?;
        if step.is_journaled() {
            self.entries_sent += 1;
            // The ramp waits for this entry.
            self.wake();
        }
        if self.waits_for_disk { self.wait_while(|own| !own.is_on_disk()) } else { Ok(()) }
    }
}

impl Drop for BackgroundRecorder {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Release);
    }
}
