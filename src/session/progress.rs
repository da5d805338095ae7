//! Progress of a session: trials done and trials left. It changes by transitions only, so that the journal can restore it.

use std::collections::VecDeque;

use super::event::Event;
use super::io::{
    Attempt, MaximalEffort, RecordTarget, RigAttempt, Status, TransitionDetail, TransitionRecord,
};
use super::phase::Phase;
use super::settings::{PlannedTrial, Settings};
use super::transitions::{self, Effect, Guard};
use crate::protocol::{PlannedRigTrial, RigLoad};
use crate::rig::{Direction, Punctuality};
use crate::schedule;

/// Progress of a session: attempts so far, trials left, offset and maximal efforts.
#[derive(Debug, Clone, PartialEq)]
pub struct Progress {
    seed: u64,
    /// Whether rig trials are to be run, and the operator has not said yet that the subject is seated after them.
    rig_trials_due: bool,
    rig_queue: VecDeque<PlannedRigTrial>,
    rig_attempts: Vec<RigAttempt>,
    /// The load that the operator has mounted, as far as it is known; after an interruption it is mounted anew.
    mounted: Option<RigLoad>,
    offset_due: bool,
    efforts_planned: usize,
    queue: VecDeque<PlannedTrial>,
    attempts: Vec<Attempt>,
    offset_nm: f64,
    efforts: Vec<MaximalEffort>,
    /// Efforts that the operator added, those that are done.
    efforts_repeated: usize,
    /// Whether the next effort repeats the last one.
    repeats_effort: bool,
    /// Whether the first rest before a trial has begun after the efforts: from then on EMG is measured in their size.
    efforts_over: bool,
    pause_asked: bool,
}

/// Efforts for which there is room: the control loop must not allocate.
const EFFORTS_EXPECTED: usize = 64;

/// Attempts for which there is room, several of every trial: the control loop must not allocate.
fn attempts_expected(trials: usize) -> usize {
    if trials == 0 { 0 } else { 8 * trials + 64 }
}

impl Progress {
    /// The progress of a session that has not begun.
    pub fn new(settings: &Settings) -> Self {
        Self {
            seed: settings.seed,
            rig_trials_due: !settings.rig_plan.is_empty(),
            rig_queue: settings.rig_plan.iter().copied().collect(),
            rig_attempts: Vec::with_capacity(attempts_expected(settings.rig_plan.len())),
            mounted: None,
            offset_due: settings.offset_samples.is_some(),
            efforts_planned: settings.mvc.as_ref().map_or(0, |mvc| 2 * mvc.efforts as usize),
            queue: settings.plan.iter().copied().collect(),
            attempts: Vec::with_capacity(attempts_expected(settings.plan.len())),
            offset_nm: 0.0,
            efforts: Vec::with_capacity(EFFORTS_EXPECTED),
            efforts_repeated: 0,
            repeats_effort: false,
            efforts_over: false,
            pause_asked: false,
        }
    }

    /// Every trial that has begun, in order.
    pub fn attempts(&self) -> &[Attempt] {
        &self.attempts
    }

    /// The trials left, the next one first.
    pub fn queue(&self) -> impl ExactSizeIterator<Item = &PlannedTrial> {
        self.queue.iter()
    }

    /// The trial under way.
    pub fn current(&self) -> Option<&Attempt> {
        self.attempts.last().filter(|attempt| attempt.ended.is_none())
    }

    /// Whether rig trials are to be run, and the operator has not said yet that the subject is seated after them.
    pub fn rig_trials_due(&self) -> bool {
        self.rig_trials_due
    }

    /// Every rig trial that has begun, in order.
    pub fn rig_attempts(&self) -> &[RigAttempt] {
        &self.rig_attempts
    }

    /// The rig trials left, the next one first.
    pub fn rig_queue(&self) -> impl ExactSizeIterator<Item = &PlannedRigTrial> {
        self.rig_queue.iter()
    }

    /// The rig trial under way.
    pub fn current_rig_trial(&self) -> Option<&RigAttempt> {
        self.rig_attempts.last().filter(|attempt| attempt.ended.is_none())
    }

    /// The load that the operator has mounted, as far as it is known.
    pub fn mounted(&self) -> Option<RigLoad> {
        self.mounted
    }

    /// Torque with the hand relaxed, N m; 0 if the protocol does not measure it.
    pub fn offset_nm(&self) -> f64 {
        self.offset_nm
    }

    /// The maximal efforts that are done, in order.
    pub fn efforts(&self) -> &[MaximalEffort] {
        &self.efforts
    }

    /// Number of maximal efforts still to come.
    pub fn efforts_left(&self) -> usize {
        self.efforts_planned.saturating_sub(self.efforts_in_turn()) + usize::from(self.repeats_effort)
    }

    /// The direction of the next maximal effort: flexion and extension in turn, but that of the last one if it is repeated.
    pub fn effort_direction(&self) -> Direction {
        match self.efforts.last().filter(|_| self.repeats_effort) {
            Some(last) => last.direction,
            None if self.efforts_in_turn().is_multiple_of(2) => Direction::Flexion,
            None => Direction::Extension,
        }
    }

    /// Number of the maximal effort that is under way or comes next, from 1.
    pub fn effort_number(&self) -> u32 {
        self.efforts.len() as u32 + 1
    }

    /// The size of a maximal effort in the units of EMG used so far (FCR, ECR): the best of each direction. `None` until the
    /// efforts are over.
    pub fn emg_factors(&self) -> Option<[f64; 2]> {
        let best = |direction, peak: fn(&MaximalEffort) -> f64| {
            self.efforts.iter().filter(|effort| effort.direction == direction).map(peak).fold(0.0, f64::max)
        };
        self.efforts_over.then(|| {
            [
                best(Direction::Flexion, |effort| effort.peak_fcr),
                best(Direction::Extension, |effort| effort.peak_ecr),
            ]
        })
    }

    /// Efforts that were done in the order of the protocol, without those that the operator added.
    fn efforts_in_turn(&self) -> usize {
        self.efforts.len() - self.efforts_repeated
    }

    /// Whether a guard of the table holds.
    pub fn holds(&self, guard: Guard) -> bool {
        match guard {
            Guard::Always => true,
            Guard::RigTrialsDue => self.rig_trials_due,
            Guard::LoadMounted => {
                let next = self.rig_queue.front().filter(|_| self.rig_trials_due);
                next.is_some_and(|next| self.mounted == Some(next.load))
            }
            Guard::OffsetDue => self.offset_due,
            Guard::EffortsDue => self.efforts_left() > 0,
            Guard::EffortRepeatable => !self.efforts.is_empty() && !self.repeats_effort && !self.efforts_over,
            Guard::TrialsLeft if self.rig_trials_due => !self.rig_queue.is_empty(),
            Guard::TrialsLeft => !self.queue.is_empty(),
            Guard::OneTrialLeft => self.queue.len() == 1,
            Guard::PauseAsked => self.pause_asked,
            Guard::LastTrialCounts => self.last_counts(),
        }
    }

    /// The line of the table that an event takes from a phase.
    pub fn line(&self, from: Phase, event: Event) -> Option<&'static transitions::Transition> {
        transitions::lines(from, event).find(|line| self.holds(line.guard))
    }

    /// Applies a transition.
    pub fn apply(&mut self, transition: &TransitionRecord) {
        let line =
            transitions::lines(transition.from, transition.event).find(|line| line.to == transition.to);
        let Some(line) = line else { return };
        if line.to == Phase::Paused && line.from != Phase::Paused {
            self.pause_asked = false;
        }
        self.efforts_over |= line.to == Phase::Rest && !self.efforts.is_empty() && self.efforts_left() == 0;
        // Where the operator intervened, the load is confirmed anew: it may have been exchanged already.
        let intervened = matches!(transition.event, Event::Skip | Event::Repeat);
        if intervened || !matches!(line.to, Phase::RigSetup | Phase::RigSettle | Phase::RigMotion) {
            self.mounted = None;
        }
        match line.effect {
            Effect::None => {}
            _ if self.rig_trials_due => self.apply_to_rig_trials(line.effect, transition),
            Effect::NotePause => self.pause_asked = true,
            // Only rig trials end with it.
            Effect::SeatSubject => {}
            Effect::KeepOffset => self.keep_offset(transition),
            Effect::KeepEffort => self.keep_effort(transition),
            Effect::RepeatEffort => self.repeats_effort = true,
            Effect::Begin => self.begin(transition),
            Effect::Ok => self.end(Status::Ok, transition),
            Effect::Reject => {
                self.end(Status::Rejected, transition);
                self.put_back_later(1);
            }
            Effect::Abort => {
                self.end(Status::Aborted, transition);
                self.put_back_later(0);
            }
            Effect::LeaveOut => self.end(Status::Aborted, transition),
            Effect::LeaveOutNext => {
                self.queue.pop_front();
            }
            Effect::TakeBack => self.take_back(),
        }
        if line.effect == Effect::None && line.from == Phase::Delay && transition.event == Event::Onset {
            self.note_onset(transition);
        }
    }

    /// Applies the effect of a transition before the subject is seated. A rig trial that is put back comes next: its load is
    /// still mounted, or is mounted next.
    fn apply_to_rig_trials(&mut self, effect: Effect, transition: &TransitionRecord) {
        match effect {
            Effect::Begin => self.begin_rig_trial(transition),
            Effect::Ok => self.end_rig_trial(Status::Ok, transition),
            Effect::Reject => {
                self.end_rig_trial(Status::Rejected, transition);
                self.put_back_rig_trial(1);
            }
            Effect::Abort => {
                self.end_rig_trial(Status::Aborted, transition);
                self.put_back_rig_trial(0);
            }
            Effect::LeaveOut => self.end_rig_trial(Status::Aborted, transition),
            Effect::LeaveOutNext => {
                self.rig_queue.pop_front();
            }
            Effect::TakeBack => {
                if let Some(attempt) = self.rig_attempts.last_mut() {
                    attempt.ended = Some((Status::Rejected, Event::Repeat));
                }
                self.put_back_rig_trial(1);
            }
            Effect::NotePause => self.pause_asked = true,
            Effect::SeatSubject => self.rig_trials_due = false,
            // What comes after the subject is seated.
            Effect::None | Effect::KeepOffset | Effect::KeepEffort | Effect::RepeatEffort => {}
        }
    }

    fn begin_rig_trial(&mut self, transition: &TransitionRecord) {
        let (Some(planned), Some(TransitionDetail::Began { number, .. })) =
            (self.rig_queue.pop_front(), transition.detail)
        else {
            return;
        };
        self.mounted = Some(planned.load);
        self.rig_attempts.push(RigAttempt { number, planned, ended: None, samples: 0 });
    }

    fn end_rig_trial(&mut self, status: Status, transition: &TransitionRecord) {
        let (samples, _) = ended_record(transition);
        if let Some(attempt) = self.rig_attempts.last_mut().filter(|attempt| attempt.ended.is_none()) {
            attempt.ended = Some((status, transition.event));
            attempt.samples = samples;
        }
    }

    fn put_back_rig_trial(&mut self, rejections: u32) {
        let Some(mut planned) = self.rig_attempts.last().map(|attempt| attempt.planned) else { return };
        planned.rejections += rejections;
        self.rig_queue.push_front(planned);
    }

    /// Aborts the trial or rig trial that was under way when the program ended, with `samples` samples in its record, and puts
    /// it back. Returns its number.
    pub fn interrupt(&mut self, samples: u64) -> Option<u32> {
        self.mounted = None;
        if let Some(attempt) = self.rig_attempts.last_mut().filter(|attempt| attempt.ended.is_none()) {
            attempt.ended = Some((Status::Aborted, Event::Abort));
            attempt.samples = samples;
            let number = attempt.number;
            self.put_back_rig_trial(0);
            return Some(number);
        }
        let attempt = self.attempts.last_mut().filter(|attempt| attempt.ended.is_none())?;
        attempt.ended = Some((Status::Aborted, Event::Abort));
        attempt.samples = samples;
        // The last samples before the crash, and with them the onset, may be missing on the disk.
        attempt.onset_sample = attempt.onset_sample.filter(|onset| *onset < samples);
        let number = attempt.number;
        self.put_back_later(0);
        Some(number)
    }

    /// Record that the samples of a phase belong to.
    pub fn record_target(&self, phase: Phase) -> RecordTarget {
        match phase {
            Phase::Offset => RecordTarget::Offset,
            Phase::MvcEffort => RecordTarget::Effort(self.effort_number()),
            phase if phase.in_rig_trial() => RecordTarget::RigTrial,
            phase if phase.in_trial() => RecordTarget::Trial,
            _ => RecordTarget::None,
        }
    }

    /// Number of the trial or rig trial that is under way.
    pub fn under_way(&self) -> Option<u32> {
        let trial = self.current().map(|trial| trial.number);
        self.current_rig_trial().map(|trial| trial.number).or(trial)
    }

    /// Number of the last trial that began, or, before the subject is seated, of the last rig trial; 0 before the first.
    pub fn last_number(&self) -> u32 {
        match self.rig_attempts.last().filter(|_| self.rig_trials_due) {
            Some(attempt) => attempt.number,
            None => self.attempts.last().map_or(0, |attempt| attempt.number),
        }
    }

    /// Number of the next trial, or rig trial, in its table.
    pub fn next_number(&self) -> u32 {
        if self.rig_trials_due {
            return 1 + self.rig_attempts.len() as u32;
        }
        let practice = self.queue.front().is_some_and(|planned| planned.key.practice);
        1 + self.attempts.iter().filter(|attempt| attempt.planned.key.practice == practice).count() as u32
    }

    fn keep_offset(&mut self, transition: &TransitionRecord) {
        if let Some(TransitionDetail::OffsetNm(offset_nm)) = transition.detail {
            self.offset_nm = offset_nm;
            self.offset_due = false;
        }
    }

    fn keep_effort(&mut self, transition: &TransitionRecord) {
        if let Some(TransitionDetail::Effort { peak_torque_nm, peak_fcr, peak_ecr }) = transition.detail {
            let direction = self.effort_direction();
            self.efforts.push(MaximalEffort { direction, peak_torque_nm, peak_fcr, peak_ecr });
            self.efforts_repeated += usize::from(std::mem::take(&mut self.repeats_effort));
        }
    }

    fn begin(&mut self, transition: &TransitionRecord) {
        let (Some(planned), Some(TransitionDetail::Began { number, rest_samples, .. })) =
            (self.queue.pop_front(), transition.detail)
        else {
            return;
        };
        self.attempts.push(Attempt {
            number,
            planned,
            rest_samples,
            onset_sample: None,
            ended: None,
            samples: 0,
            punctuality: None,
        });
    }

    fn note_onset(&mut self, transition: &TransitionRecord) {
        if let (Some(attempt), Some(TransitionDetail::Onset { trial_sample, .. })) =
            (self.attempts.last_mut(), transition.detail)
        {
            attempt.onset_sample = Some(trial_sample);
        }
    }

    fn end(&mut self, status: Status, transition: &TransitionRecord) {
        let (samples, punctuality) = ended_record(transition);
        if let Some(attempt) = self.attempts.last_mut().filter(|attempt| attempt.ended.is_none()) {
            attempt.ended = Some((status, transition.event));
            attempt.samples = samples;
            attempt.punctuality = punctuality;
        }
    }

    /// Puts the last trial back among the trials left, at a random place. Practice trials are not repeated.
    fn put_back_later(&mut self, rejections: u32) {
        let Some(mut planned) = self.last_measured() else { return };
        planned.key.rejections += rejections;
        let number = self.attempts.last().map_or(0, |attempt| attempt.number);
        self.queue.insert(schedule::put_back(self.seed, number, self.queue.len()), planned);
    }

    /// Rejects the last trial and makes it the next one, with new random numbers.
    fn take_back(&mut self) {
        let Some(mut planned) = self.last_measured() else { return };
        if let Some(attempt) = self.attempts.last_mut() {
            attempt.ended = Some((Status::Rejected, Event::Repeat));
        }
        planned.key.rejections += 1;
        self.queue.push_front(planned);
    }

    fn last_measured(&self) -> Option<PlannedTrial> {
        self.attempts.last().map(|attempt| attempt.planned).filter(|planned| !planned.key.practice)
    }

    fn last_counts(&self) -> bool {
        if self.rig_trials_due {
            let last = self.rig_attempts.last();
            return last.is_some_and(|attempt| matches!(attempt.ended, Some((Status::Ok, _))));
        }
        self.last_measured().is_some()
            && self.attempts.last().is_some_and(|attempt| matches!(attempt.ended, Some((Status::Ok, _))))
    }
}

/// Samples of the record of a trial that ended, and how punctual its periods were.
fn ended_record(transition: &TransitionRecord) -> (u64, Option<Punctuality>) {
    match transition.detail {
        Some(
            TransitionDetail::Ended { samples, punctuality, .. }
            | TransitionDetail::FaultInTrial { samples, punctuality, .. },
        ) => (samples, punctuality),
        _ => (0, None),
    }
}
