//! One start of a session goes through the state machine again.

use std::ops::ControlFlow;
use std::sync::Arc;

use super::difference::Difference;
use super::expected_step::{ExpectedStep, StepEntry, describe, describe_line, describe_step, expected};
use super::garbage::Garbage;
use super::recorded_samples::RecordedSamples;
use crate::dataset::error::DatasetError;
use crate::dataset::journal::JournalEntry;
use crate::dataset::recovery::{RecoveredSession, RecoveredState};
use crate::protocol::Limits;
use crate::rig::{Motor, Sample};
use crate::session::{
    Event, Input, Machine, Output, Phase, Reading, RecordTarget, Settings, Source, Step, TransitionDetail,
    TransitionRecord,
};

/// Longest plausible wait for the operator, s; a longer one in the journal is an error.
const LONGEST_WAIT_S: f64 = 7.0 * 86_400.0;

/// Steps between two looks at whether the session only waits for the operator.
const SETTLING_STEPS: u64 = 1 << 12;

/// Called after each step that came out as recorded, with the step and the state machine after it. Can end the replay. Where
/// nothing changes in a pause any more, the next step is that which ends the pause.
pub type StepObserver<'a> = dyn FnMut(&Step, &Machine) -> ControlFlow<()> + 'a;

/// Replays one start of the session.
pub(super) struct Replayer<'a> {
    session: &'a RecoveredSession,
    pub(super) machine: Machine,
    pub(super) state: RecoveredState,
    limits: Limits,
    start: usize,
    /// The program lived to end this start of the session.
    pub(super) ended_well: bool,
    rows: Option<RecordedSamples>,
    pub(super) garbage: Vec<Garbage>,
    angle_rad: f64,
    pub(super) events: usize,
    /// The observer has ended the replay.
    pub(super) is_stopped: bool,
}

impl<'a> Replayer<'a> {
    pub(super) fn new(session: &'a RecoveredSession, state: RecoveredState, start: usize) -> Self {
        let mut settings = Settings::clone(&session.settings);
        let limits = std::mem::replace(&mut settings.limits, no_limits());
        let machine = Machine::with_progress(Arc::new(settings), state.progress.clone());
        Self {
            session,
            machine,
            state,
            limits,
            start,
            ended_well: true,
            rows: None,
            garbage: Vec::new(),
            angle_rad: 0.0,
            events: 0,
            is_stopped: false,
        }
    }

    /// Replays the entries of the journal; returns the first difference.
    pub(super) fn play(
        &mut self,
        lines: &[ExpectedStep],
        mut observer: Option<&mut StepObserver>,
    ) -> Result<Option<Difference>, DatasetError> {
        let longest = (LONGEST_WAIT_S * self.session.settings.sample_rate_hz) as u64;
        let mut lines = lines;
        loop {
            let step = self.machine.sample();
            let now = lines.iter().take_while(|line| line.sample == step).count();
            let (due, later) = lines.split_at(now);
            let (transition, refused) = expected(due);
            let waits = later.first().map(|line| line.sample.saturating_sub(step));
            let rows_left = self.rows_are_left();
            let may_go_on = self.machine.phase().is_armed()
                && (rows_left || waits.is_some_and(|samples| samples <= longest));
            if due.is_empty() && !may_go_on {
                // Where the program was killed, the last samples of a record may tell no more.
                let missed = later.first().map(|line| describe_line(&line.record));
                return Ok(missed.map(|recorded| self.difference(step, recorded, "nothing".to_owned())));
            }
            let phase = self.machine.phase();
            let next = later.first().map(|line| &line.record);
            let Some(input) = self.input(transition, refused, next) else {
                if self.loses_its_end(lines) {
                    return Ok(None);
                }
                let recorded = transition.map_or("a state that goes on".to_owned(), |it| describe(&it));
                return Ok(Some(self.difference(step, recorded, "the end of the record".to_owned())));
            };
            let before = (matches!(phase, Phase::Paused | Phase::RigSetup)
                && step.is_multiple_of(SETTLING_STEPS))
            .then(|| self.machine.clone());
            let output = self.machine.step(&input);
            if due.is_empty() && later.is_empty() && !self.ended_well && !self.rows_are_left() {
                // The last sample of all may have decided something that never came to be in the journal, and so was not
                // acted on either.
                return Ok(None);
            }
            if output.transition != transition || output.refused != refused {
                let recorded = describe_step(transition, refused);
                let replayed = describe_step(output.transition, output.refused);
                let mut difference = self.difference(step, recorded, replayed);
                difference.phase = phase;
                return Ok(Some(difference));
            }
            if let Some((recorded, replayed)) = self.target_differs(output.target_rad) {
                let target = |target_rad: f64| format!("a target of {target_rad} rad");
                return Ok(Some(self.difference(step, target(recorded), target(replayed))));
            }
            self.events += usize::from(transition.is_some());
            if let Some(difference) = self.follow(&output)? {
                return Ok(Some(difference));
            }
            if let Some(observer) = &mut observer
                && observer(&Step::new(&input, &output, &self.machine), &self.machine).is_break()
            {
                self.is_stopped = true;
                return Ok(None);
            }
            lines = later;
            // A pause of days is not stepped through: nothing happens in it.
            if let (Some(before), Some(next)) = (before, lines.first())
                && self.machine.only_waits_since(&before)
            {
                self.machine.pass(next.sample.saturating_sub(self.machine.sample()));
            }
        }
    }

    /// The recorded and the replayed target of the sample that was replayed last, rad, if the record has another one.
    fn target_differs(&self, target_rad: f64) -> Option<(f64, f64)> {
        let recorded_rad = self.rows.as_ref()?.last_target_rad()?;
        let replayed_rad = Sample { theta_m_rad: target_rad, ..Sample::default() }.rounded().theta_m_rad;
        (recorded_rad != replayed_rad).then_some((recorded_rad, replayed_rad))
    }

    fn rows_are_left(&self) -> bool {
        self.rows.as_ref().is_some_and(|rows| rows.left() > 0)
    }

    /// Whether the record under way may be shorter than the journal tells: a machine that lost its power has the journal
    /// on its disk, of the samples perhaps less. Nothing that came later depends on them: the trial counts as aborted.
    fn loses_its_end(&self, left: &[ExpectedStep]) -> bool {
        let stays = |line: &ExpectedStep| match line.record {
            StepEntry::Transition(transition) => transition.to.in_trial(),
            StepEntry::Refused(_) => true,
        };
        !self.ended_well && left.iter().all(stays)
    }

    fn difference(&self, sample: u64, recorded: String, replayed: String) -> Difference {
        let trial = self.machine.progress().under_way();
        Difference { start: self.start, sample, phase: self.machine.phase(), trial, recorded, replayed }
    }

    /// Input of the state machine at this step; `None` at the end of the record.
    fn input(
        &mut self,
        transition: Option<TransitionRecord>,
        refused: Option<Event>,
        next: Option<&StepEntry>,
    ) -> Option<Input> {
        let said = transition.map(|it| it.event).filter(|event| event.source() == Source::Operator);
        let operator = refused.or(said);
        let arms = matches!(operator, Some(Event::Start | Event::Rearm));
        let fault = match transition.and_then(|it| it.detail) {
            Some(TransitionDetail::Fault(fault) | TransitionDetail::FaultInTrial { fault, .. }) => {
                Some(fault)
            }
            _ => None,
        };
        let reading = if let Some(fault) = fault {
            Reading::Fault(fault)
        } else if !self.machine.phase().is_armed() && !arms {
            Reading::Disarmed
        } else if let Some(rows) = &mut self.rows {
            // By the first rules, the sample that ended a record was not in it.
            rows.next_reading(self.session.rules < 2)?
        } else {
            if let Some(TransitionDetail::Rearmed { angle_rad }) = transition.and_then(|it| it.detail) {
                self.angle_rad = angle_rad;
            }
            Reading::Sample(Sample { theta_m_rad: self.angle_rad, ..Sample::default() })
        };
        let punctuality = match transition.and_then(|it| it.detail) {
            Some(
                TransitionDetail::Ended { punctuality, .. }
                | TransitionDetail::FaultInTrial { punctuality, .. },
            ) => punctuality,
            _ => None,
        };
        Some(Input { reading, operator, on_disk: self.was_on_disk(transition, next), punctuality })
    }

    /// Whether the disk was done. What the journal tells is only that a ramp waited for it.
    fn was_on_disk(&self, transition: Option<TransitionRecord>, next: Option<&StepEntry>) -> bool {
        let is_onset = |it: &TransitionRecord| it.event == Event::Onset;
        let waits = matches!(self.machine.phase(), Phase::Delay | Phase::RigSettle);
        if !waits || transition.as_ref().is_some_and(is_onset) {
            return true;
        }
        match next {
            Some(StepEntry::Transition(TransitionRecord {
                detail: Some(TransitionDetail::Onset { waited_samples, .. }),
                ..
            })) => *waited_samples == 0,
            Some(StepEntry::Refused(_)) => true,
            // The delay was broken off; how long it was to last is not in question then.
            Some(StepEntry::Transition(_)) | None => false,
        }
    }

    /// Opens and closes the records that belong to the state the session is in now.
    fn follow(&mut self, output: &Output) -> Result<Option<Difference>, DatasetError> {
        if let Motor::Follow { angle_rad } = output.command.motor {
            self.angle_rad = angle_rad;
        }
        let Some(transition) = output.transition else { return Ok(None) };
        let before = self.state.open.clone();
        self.state.apply(&JournalEntry::Transition(transition));
        if self.state.open == before {
            return Ok(None);
        }
        if let Some(left) = self.rows.take().map(|rows| rows.left()).filter(|left| *left > 0) {
            let recorded = format!("{left} more samples");
            let replayed = describe(&transition);
            return Ok(Some(self.difference(self.machine.sample() - 1, recorded, replayed)));
        }
        if let Some(file) = self.state.open.clone() {
            debug_assert_ne!(output.record, RecordTarget::None);
            self.rows = Some(RecordedSamples::read(self.session, &file, &self.limits, &mut self.garbage)?);
        }
        Ok(None)
    }
}

/// Limits that no sample exceeds: in a replay, faults come from the journal.
fn no_limits() -> Limits {
    Limits {
        angle_rad: [f64::MIN, f64::MAX],
        speed_rad_s: f64::MAX,
        acceleration_rad_s2: f64::MAX,
        torque_nm: f64::MAX,
    }
}
