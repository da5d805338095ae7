//! One step of the session, as the control loop hands it to the recorder and the console.

use std::convert::Infallible;

use super::event::Event;
use super::io::{Input, Output, Reading, RecordTarget, TransitionRecord};
use super::machine::Machine;
use super::phase::Phase;
use super::progress::Progress;
use crate::rig::{Cue, Origin, Sample};
use crate::timing::ClockStamp;

/// One step of the session: what was measured, decided and shown at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Samples since the session was started or resumed, this one included.
    pub sample: u64,
    /// Measured sample; `None` while the rig is disarmed and at a fault, whose values are in the journal.
    pub measured: Option<Sample>,
    /// When the sample was had, if that is kept of it.
    pub clock: Option<ClockStamp>,
    /// Record that the sample belongs to.
    pub record: RecordTarget,
    /// Transition of the state machine at this sample, if there was one.
    pub transition: Option<TransitionRecord>,
    /// Operator's command that was refused at this sample, if there was one.
    pub refused: Option<Event>,
    /// Phase after the step.
    pub phase: Phase,
    /// Cue that the subject sees until the next sample.
    pub cue: Cue,
    /// Angle that was commanded for the sample, rad.
    pub target_rad: f64,
    /// Low-pass filtered torque without the offset, N m, as the subject sees it.
    pub feedback_torque_nm: f64,
    /// Smoothed rectified EMG of flexor and extensor, fraction of MVC; `None` where it is not measured.
    pub feedback_emg_mvc: [Option<f64>; 2],
    /// Fraction of the gate's time that the torque has been in the band, 0 to 1.
    pub gate_fraction: f64,
}

impl Step {
    /// The step that `machine` made of `input`, with `output` as its result.
    pub fn new(input: &Input, output: &Output, machine: &Machine) -> Self {
        let measured = match (&input.reading, output.transition) {
            // A sample that broke a limit may not be finite; the journal keeps the fault's value.
            (_, Some(TransitionRecord { event: Event::Fault, .. })) => None,
            (Reading::Sample(sample), _) => Some(*sample),
            _ => None,
        };
        let feedback = machine.feedback();
        Self {
            sample: machine.sample(),
            measured,
            clock: None,
            record: output.record,
            transition: output.transition,
            refused: output.refused,
            phase: output.phase,
            cue: output.command.cue,
            target_rad: output.target_rad,
            feedback_torque_nm: feedback.torque_nm - machine.progress().offset_nm(),
            feedback_emg_mvc: [feedback.fcr_mvc, feedback.ecr_mvc],
            gate_fraction: output.gate_fraction,
        }
    }

    /// Whether a recorder has something to write: a sample of a record or an entry of the journal.
    pub fn is_recorded(&self) -> bool {
        self.record != RecordTarget::None || self.is_journaled() || self.clock.is_some()
    }

    /// Whether the step makes an entry in the journal.
    pub fn is_journaled(&self) -> bool {
        self.transition.is_some() || self.refused.is_some()
    }
}

/// Receives each step of a running session; the recorder and the console are consumers.
pub trait StepConsumer {
    /// Reason why a step could not be kept; it ends the session.
    type Error;

    /// Whether all steps received so far are on disk. The ramp waits for it.
    fn is_on_disk(&self) -> bool {
        true
    }

    /// Takes note of how the rig knew its start position when it was armed, `sample` samples after the session was started
    /// or resumed. The ramp waits until it is on disk. With a real-time rig this must not block.
    fn note_origin(&mut self, _origin: Origin, _sample: u64) -> Result<(), Self::Error> {
        Ok(())
    }

    /// Takes one step; `progress` is the session's progress after it. With a real-time rig this must not block.
    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), Self::Error>;
}

/// A consumer that may be there or not.
impl<A: StepConsumer<Error = Infallible>> StepConsumer for Option<A> {
    type Error = Infallible;

    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), Infallible> {
        self.as_mut().map_or(Ok(()), |own| own.consume(step, progress))
    }
}

/// Two consumers of the same steps. The first one (the recorder) decides whether the session can go on.
impl<A: StepConsumer, B: StepConsumer<Error = Infallible>> StepConsumer for (A, B) {
    type Error = A::Error;

    fn is_on_disk(&self) -> bool {
        self.0.is_on_disk()
    }

    fn note_origin(&mut self, origin: Origin, sample: u64) -> Result<(), A::Error> {
        self.0.note_origin(origin, sample)?;
        let Ok(()) = self.1.note_origin(origin, sample);
        Ok(())
    }

    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), A::Error> {
        self.0.consume(step, progress)?;
        let Ok(()) = self.1.consume(step, progress);
        Ok(())
    }
}
