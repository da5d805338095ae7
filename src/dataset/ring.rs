//! Keeps a session whose loop may not wait: what the session was told goes into a ring, and a second thread, with a
//! session of its own that is told the same, does the writing.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use rtrb::{Consumer, Producer, RingBuffer};

use super::recorder::{RecordError, Recorder};
use crate::session::{Input, Machine, Output, Recorder as KeepsSession};

/// Samples that may wait for the disk: some 13 s at 2.5 kHz.
const ROOM: usize = 1 << 15;
/// How often the writer looks when there is nothing to do.
const IDLE: Duration = Duration::from_millis(2);

/// Why a session could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum RingError {
    /// The disk.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// The disk was slower than the samples for too long.
    #[error(
        "the disk is slower than the samples: {ROOM} of them wait to be written. Use a faster disk; the session can be resumed"
    )]
    Full,
    /// The thread that writes has died.
    #[error("the thread that writes the session died; what it wrote is safe and the session can be resumed")]
    WriterDied,
}

#[derive(Debug, Default)]
struct Shared {
    /// Inputs that are written.
    written: AtomicU64,
    /// No more inputs will come.
    over: AtomicBool,
    /// The writer has given up.
    failed: AtomicBool,
}

/// The loop's end of the ring.
#[derive(Debug)]
pub struct RingRecorder {
    ring: Producer<Input>,
    shared: Arc<Shared>,
    writer: Option<JoinHandle<Result<Recorder, RecordError>>>,
    pushed: u64,
    /// Inputs up to the latest one at which something happened.
    happened: u64,
}

impl RingRecorder {
    /// Starts the writer. `machine` is the session before its first step.
    pub fn start(recorder: Recorder, machine: Machine) -> Self {
        let (ring, inputs) = RingBuffer::new(ROOM);
        let shared = Arc::new(Shared::default());
        let writer = thread::spawn({
            let shared = shared.clone();
            move || {
                let outcome = write(inputs, recorder, machine, &shared);
                shared.failed.store(outcome.is_err(), Ordering::Release);
                outcome
            }
        });
        Self { ring, shared, writer: Some(writer), pushed: 0, happened: 0 }
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// What kept it from being written.
    pub fn finish(mut self) -> Result<Recorder, RingError> {
        self.end()
    }

    fn end(&mut self) -> Result<Recorder, RingError> {
        self.shared.over.store(true, Ordering::Release);
        let writer = self.writer.take().ok_or(RingError::WriterDied)?;
        Ok(writer.join().map_err(|_| RingError::WriterDied)??)
    }
}

impl KeepsSession for RingRecorder {
    type Error = RingError;

    fn take(&mut self, input: &Input, output: &Output, _machine: &Machine) -> Result<(), RingError> {
        if self.shared.failed.load(Ordering::Acquire) {
            return Err(self.end().err().unwrap_or(RingError::WriterDied));
        }
        self.ring.push(*input).map_err(|_| RingError::Full)?;
        self.pushed += 1;
        if output.happened.is_some() {
            self.happened = self.pushed;
        }
        Ok(())
    }

    fn on_disk(&self) -> bool {
        self.shared.written.load(Ordering::Acquire) >= self.happened
    }
}

impl Drop for RingRecorder {
    fn drop(&mut self) {
        self.shared.over.store(true, Ordering::Release);
    }
}

fn write(
    mut inputs: Consumer<Input>,
    mut recorder: Recorder,
    mut machine: Machine,
    shared: &Shared,
) -> Result<Recorder, RecordError> {
    loop {
        // Asked before looking, so that what came just before the end is still seen.
        let over = shared.over.load(Ordering::Acquire);
        match inputs.pop() {
            Ok(input) => {
                let output = machine.step(&input);
                recorder.take(&input, &output, &machine)?;
                shared.written.fetch_add(1, Ordering::Release);
            }
            Err(_) if over => return Ok(recorder),
            Err(_) => thread::sleep(IDLE),
        }
    }
}
