//! The feed of steps from the control loop to the console: a ring buffer that a loop with deadlines never waits for.

use std::convert::Infallible;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use crate::session::{Progress, Step, StepConsumer};

/// Number of steps that the ring holds: 26 s at 2.5 kHz, so that a busy computer costs the console no trial's fit.
const FEED_CAPACITY: usize = 1 << 16;
/// Part of the capacity reserved for steps that make a journal entry; the console must not miss those.
const RESERVED_FOR_EVENTS: usize = 1 << 10;
/// Time that a loop without deadlines sleeps while the ring is full.
const FULL_FEED_SLEEP: Duration = Duration::from_micros(50);

/// A step and the time at which it was made.
#[derive(Debug, Clone, Copy)]
pub struct TimedStep {
    /// The step.
    pub step: Step,
    /// Time of the step on the monotonic clock.
    pub at: Instant,
}

impl TimedStep {
    /// A step made now.
    pub fn now(step: &Step) -> Self {
        Self { step: *step, at: Instant::now() }
    }
}

/// Number of samples since the session was started or resumed, readable from any thread.
#[derive(Debug, Clone, Default)]
pub struct SampleCounter(Arc<AtomicU64>);

impl SampleCounter {
    /// The number of the latest sample.
    pub fn sample(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// The control loop's end of the feed.
#[derive(Debug)]
pub struct StepFeed {
    steps: Producer<TimedStep>,
    counter: SampleCounter,
    waits_for_room: bool,
}

impl StepFeed {
    /// Makes both ends of the feed. With `waits_for_room` the loop waits while the ring is full; without it, steps that
    /// find no room are dropped, those without a journal entry first.
    pub fn new(counter: SampleCounter, waits_for_room: bool) -> (Self, Consumer<TimedStep>) {
        let (steps, received) = RingBuffer::new(FEED_CAPACITY);
        (Self { steps, counter, waits_for_room }, received)
    }
}

impl StepConsumer for StepFeed {
    type Error = Infallible;

    fn consume(&mut self, step: &Step, _: &Progress) -> Result<(), Infallible> {
        self.counter.0.store(step.sample, Ordering::Relaxed);
        let needed = if step.is_journaled() { 1 } else { RESERVED_FOR_EVENTS };
        while self.waits_for_room && self.steps.slots() < needed && !self.steps.is_abandoned() {
            thread::sleep(FULL_FEED_SLEEP);
        }
        if self.steps.slots() >= needed {
            // There is room, and this is the only producer.
            let _ = self.steps.push(TimedStep::now(step));
        }
        Ok(())
    }
}
