//! A thread that writes, behind a ring, so that a slow disk never delays the loop.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;

use super::recorder::{RecordError, Recorder, Step};
use crate::session::{Input, Machine, Output, Recorder as KeepsSession};

/// Steps that the ring holds: 26 s at 2.5 kHz.
const RING: usize = 1 << 16;

/// A [`Recorder`] at work on a thread of its own.
#[derive(Debug)]
pub struct BackgroundRecorder {
    ring: Option<SyncSender<Step>>,
    thread: Option<JoinHandle<Result<(), RecordError>>>,
    /// Journal entries handed over.
    told: u64,
    /// Journal entries on disk.
    safe: Arc<AtomicU64>,
}

impl BackgroundRecorder {
    /// Takes a recorder to a thread of its own.
    pub fn start(recorder: Recorder) -> Self {
        let (ring, steps) = sync_channel(RING);
        let safe = Arc::new(AtomicU64::new(0));
        let thread = std::thread::spawn({
            let safe = safe.clone();
            move || write(recorder, &steps, &safe)
        });
        Self { ring: Some(ring), thread: Some(thread), told: 0, safe }
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// What could not be written.
    pub fn finish(mut self) -> Result<(), RecordError> {
        self.join()
    }

    fn join(&mut self) -> Result<(), RecordError> {
        // A ring without a sender ends the thread once it is empty.
        self.ring = None;
        match self.thread.take().map(JoinHandle::join) {
            Some(Ok(written)) => written,
            _ => Err(RecordError::WriterGone),
        }
    }
}

fn write(mut recorder: Recorder, steps: &Receiver<Step>, safe: &AtomicU64) -> Result<(), RecordError> {
    for step in steps {
        recorder.keep_step(&step)?;
        if step.is_told() {
            safe.fetch_add(1, Ordering::Release);
        }
    }
    Ok(())
}

impl KeepsSession for BackgroundRecorder {
    type Error = RecordError;

    fn on_disk(&self) -> bool {
        self.safe.load(Ordering::Acquire) == self.told
    }

    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), RecordError> {
        if self.thread.as_ref().is_none_or(JoinHandle::is_finished) {
            return self.join().and(Err(RecordError::WriterGone));
        }
        let step = Step::new(input, output, machine);
        let Some(ring) = self.ring.as_ref().filter(|_| step.is_kept()) else { return Ok(()) };
        self.told += u64::from(step.is_told());
        match ring.try_send(step) {
            Ok(()) => Ok(()),
            Err(TrySendError::Full(_)) => Err(RecordError::TooSlow { waiting: RING }),
            Err(TrySendError::Disconnected(_)) => self.join().and(Err(RecordError::WriterGone)),
        }
    }
}
