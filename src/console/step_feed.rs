//! What leaves the loop: a copy of each step, through a ring that the loop never waits for.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use rtrb::{Consumer, Producer, RingBuffer};

use crate::dataset::Step;
use crate::rig::Cue;
use crate::session::{Input, Machine, Output, Phase, Recorder};

/// Steps that the ring holds: 6.5 s at 2.5 kHz.
const ROOM: usize = 1 << 14;
/// So much of it is kept for steps at which something happened, which nobody can do without.
const KEPT_FREE: usize = 1 << 10;
/// How long a loop that has time waits before it looks again.
const A_MOMENT: Duration = Duration::from_micros(50);

/// One step of the session, with all that a console shows of it.
#[derive(Debug, Clone, Copy)]
pub struct TimedStep {
    /// What was measured, and what happened.
    pub step: Step,
    /// When.
    pub at: Instant,
    /// The phase after it.
    pub phase: Phase,
    /// What the person is shown.
    pub cue: Cue,
    /// The torque on the display, offset removed and smoothed, N m.
    pub shown_nm: f64,
    /// Smoothed EMG of flexor and extensor, fraction of MVC.
    pub emg_mvc: [f64; 2],
    /// How much of the gate's time has been held, 0 to 1.
    pub gate: f64,
}

impl TimedStep {
    /// What a console shows of a step.
    pub fn new(input: &Input, output: &Output, machine: &Machine) -> Self {
        let display = machine.display();
        Self {
            step: Step::new(input, output, machine),
            at: Instant::now(),
            phase: output.phase,
            cue: output.command.cue,
            shown_nm: display.torque_nm - machine.progress().offset_nm(),
            emg_mvc: [display.fcr_mvc, display.ecr_mvc],
            gate: output.gate_fraction,
        }
    }
}

/// How far the loop is, for everybody to look at.
#[derive(Debug, Clone, Default)]
pub struct SampleCounter(Arc<AtomicU64>);

impl SampleCounter {
    /// Samples since the session was started or resumed.
    pub fn sample(&self) -> u64 {
        self.0.load(Ordering::Relaxed)
    }
}

/// A recorder that lets a console look on.
#[derive(Debug)]
pub struct Tapped<K> {
    recorder: K,
    beats: Producer<TimedStep>,
    place: SampleCounter,
    is_patient: bool,
}

impl<K> Tapped<K> {
    /// Lets steps out on their way to `recorder`. A patient loop has no deadlines, and waits for whoever looks on; any
    /// other leaves out what there is no room for.
    pub fn new(recorder: K, place: SampleCounter, is_patient: bool) -> (Self, Consumer<TimedStep>) {
        let (beats, seen) = RingBuffer::new(ROOM);
        (Self { recorder, beats, place, is_patient }, seen)
    }

    /// The recorder alone.
    pub fn into_inner(self) -> K {
        self.recorder
    }

    fn let_out(&mut self, beat: TimedStep) {
        let needed = if beat.step.is_told() { 1 } else { KEPT_FREE };
        while self.is_patient && self.beats.slots() < needed && !self.beats.is_abandoned() {
            thread::sleep(A_MOMENT);
        }
        if self.beats.slots() >= needed {
            // There is room, and nobody else puts anything in.
            let _ = self.beats.push(beat);
        }
    }
}

impl<K: Recorder> Recorder for Tapped<K> {
    type Error = K::Error;

    fn on_disk(&self) -> bool {
        self.recorder.on_disk()
    }

    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), K::Error> {
        self.recorder.take(input, output, machine)?;
        self.place.0.store(machine.sample(), Ordering::Relaxed);
        self.let_out(TimedStep::new(input, output, machine));
        Ok(())
    }
}
