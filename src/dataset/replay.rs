//! Replay of a session: the recorded samples and commands go through the state machine again, and its transitions are
//! compared with the journal.
//!
//! Between the records (rests, the way back) no samples are kept. Nothing the session does there depends on them but
//! faults, and those are in the journal, so a motor that follows stands in for them. The limits are held against every
//! sample that was kept.

use std::fmt;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use super::error::DatasetError;
use super::journal::{JOURNAL, JournalEntry};
use super::recorder::part_of;
use super::recovery::{RecoveredSession, RecoveredState};
use super::tables::header_of_file;
use super::trial_csv_writer::RIG_HEADER;
use super::{FurtherChannel, trial_csv_reader};
use crate::files::{excerpt, limits};
use crate::protocol::Limits;
use crate::rig::{Fault, LimitMonitor, Motor, Sample};
use crate::session::rules::{RULES, RuleChange, changes_since};
use crate::session::{
    Event, Input, Machine, Output, Phase, Reading, RecordTarget, Settings, Source, Step, TransitionDetail,
    TransitionRecord,
};

/// Longest plausible wait for the operator, s; a longer one in the journal is an error.
const LONGEST_WAIT_S: f64 = 7.0 * 86_400.0;

/// Steps between two looks at whether the session only waits for the operator.
const SETTLING_STEPS: u64 = 1 << 12;

/// Result of a replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Steps of the state machine.
    pub steps: u64,
    /// Events that are the same as in the journal.
    pub events: usize,
    /// How often the session was started: once, and once more for every time it was resumed.
    pub starts: usize,
    /// First difference from the record.
    pub difference: Option<Difference>,
    /// Files that are not as the journal has them, with what became of each.
    pub changed_files: Vec<String>,
    /// Bytes behind the journal or a record that belong to neither.
    pub garbage: Vec<Garbage>,
    /// The program that recorded it.
    pub program: String,
    /// The rules in force when it was recorded.
    pub rules: u32,
}

/// Bytes behind the end of a file that are no part of it.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Garbage {
    /// The file.
    pub file: String,
    /// How many bytes.
    pub bytes: u64,
    /// The program died while it wrote the file, which explains them.
    pub is_torn_end: bool,
}

impl fmt::Display for Garbage {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let why = if self.is_torn_end { ": the program ended while it wrote them" } else { "" };
        write!(out, "{}: {} bytes behind its end belong to no record{why}", excerpt(&self.file), self.bytes)
    }
}

/// First difference between a replay and the record.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Which start of the session, from 1: it was resumed in between.
    pub start: usize,
    /// Sample since then.
    pub sample: u64,
    /// State in which it was met.
    pub phase: Phase,
    /// Number of the trial under way.
    pub trial: Option<u32>,
    /// Entry in the journal.
    pub recorded: String,
    /// Outcome of the replay.
    pub replayed: String,
}

impl Replay {
    /// What has changed in the rules since the session was recorded.
    pub fn changed_rules(&self) -> impl Iterator<Item = &'static RuleChange> {
        changes_since(self.rules)
    }

    /// Whether the session came out as recorded, from files that are as they were.
    pub fn is_sound(&self) -> bool {
        self.difference.is_none()
            && self.changed_files.is_empty()
            && self.garbage.iter().all(|garbage| garbage.is_torn_end)
    }

    /// Whether the session was recorded by rules that this program does not know yet.
    pub fn is_from_the_future(&self) -> bool {
        self.rules > RULES
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(out, "sample {}", self.sample)?;
        if self.start > 1 {
            write!(out, " after resume number {}", self.start - 1)?;
        }
        write!(out, ", in state {}", self.phase.name())?;
        if let Some(trial) = self.trial {
            write!(out, " (trial {trial})")?;
        }
        write!(out, ": recorded {}, replayed {}", self.recorded, self.replayed)
    }
}

/// Called after each step that came out as recorded, with the step and the state machine after it. Can end the replay. Where
/// nothing changes in a pause any more, the next step is that which ends the pause.
pub type StepObserver<'a> = dyn FnMut(&Step, &Machine) -> ControlFlow<()> + 'a;

/// Goes through the session in `folder` again, up to the first difference.
///
/// # Errors
/// If the folder cannot be read, or its journal is damaged in the middle.
pub fn replay(folder: &Path) -> Result<Replay, DatasetError> {
    replay_session(folder, None)
}

/// As [`replay`], calling `observer` after each step.
///
/// # Errors
/// As [`replay`].
pub fn replay_watched(folder: &Path, observer: &mut StepObserver) -> Result<Replay, DatasetError> {
    replay_session(folder, Some(observer))
}

fn replay_session(folder: &Path, mut observer: Option<&mut StepObserver>) -> Result<Replay, DatasetError> {
    let session = RecoveredSession::read(folder)?;
    session.undamaged()?;
    let mut state = RecoveredState::new(&session.settings);
    let mut replay = Replay {
        steps: 0,
        events: 0,
        starts: 0,
        difference: None,
        changed_files: session.changed_files()?,
        garbage: Vec::new(),
        program: session.program.clone(),
        rules: session.rules,
    };
    let records: Vec<&JournalEntry> = session.journal.records.iter().map(|placed| &placed.record).collect();
    if let Some(torn) = &session.journal.torn {
        let lines: Vec<ExpectedStep> = records.iter().filter_map(|record| ExpectedStep::of(record)).collect();
        let is_torn_end = is_under_way(&lines);
        replay.garbage.push(Garbage { file: session.folder.name(JOURNAL), bytes: torn.length, is_torn_end });
    }
    // The first record describes the session.
    for part in records[1..].split_inclusive(|record| matches!(record, JournalEntry::Resumed { .. })) {
        let resumed = part.last().filter(|record| matches!(record, JournalEntry::Resumed { .. }));
        let lines: Vec<ExpectedStep> = part.iter().filter_map(|record| ExpectedStep::of(record)).collect();
        replay.starts += 1;
        let mut player = Replayer::new(&session, state, replay.starts);
        player.ended_well = resumed.is_none() && !is_under_way(&lines);
        let played = player.play(&lines, observer.as_deref_mut())?;
        replay.garbage.append(&mut player.garbage);
        replay.steps += player.machine.sample();
        replay.events += player.events;
        if player.is_stopped {
            return Ok(replay);
        }
        if let Some(difference) = played {
            replay.difference = Some(difference);
            return Ok(replay);
        }
        state = player.state;
        if let Some(record) = resumed {
            state.apply(record);
        }
    }
    Ok(replay)
}

/// Whether the last thing that a journal tells leaves the session going on: the program did not live to end it.
fn is_under_way(lines: &[ExpectedStep]) -> bool {
    let last = lines.iter().rev().find_map(|line| match line.record {
        StepEntry::Transition(transition) => Some(transition.to),
        StepEntry::Refused(_) => None,
    });
    last.is_none_or(Phase::is_armed)
}

/// What the journal says of one step.
#[derive(Debug, Clone, Copy)]
struct ExpectedStep {
    sample: u64,
    record: StepEntry,
}

#[derive(Debug, Clone, Copy)]
enum StepEntry {
    Transition(TransitionRecord),
    Refused(Event),
}

impl ExpectedStep {
    fn of(record: &JournalEntry) -> Option<Self> {
        match record {
            JournalEntry::Transition(transition) => {
                Some(Self { sample: transition.sample, record: StepEntry::Transition(*transition) })
            }
            // It was noted after the step was counted.
            JournalEntry::Refused { sample, command } => {
                Some(Self { sample: sample.saturating_sub(1), record: StepEntry::Refused(*command) })
            }
            JournalEntry::Session { .. }
            | JournalEntry::Resumed { .. }
            | JournalEntry::Console(_)
            | JournalEntry::Recorded(_)
            | JournalEntry::Origin { .. }
            | JournalEntry::Clock { .. } => None,
        }
    }
}

/// Samples of the record that is being replayed.
#[derive(Debug, Default)]
struct RecordedSamples {
    samples: Vec<Sample>,
    /// The angle commanded for each sample, rad; none but in the record of a rig trial.
    targets_rad: Vec<f64>,
    next: usize,
    /// The first sample that breaks a limit.
    breaks: Option<(usize, Fault)>,
}

/// Replays one start of the session.
struct Replayer<'a> {
    session: &'a RecoveredSession,
    machine: Machine,
    state: RecoveredState,
    limits: Limits,
    start: usize,
    /// The program lived to end this start of the session.
    ended_well: bool,
    rows: Option<RecordedSamples>,
    garbage: Vec<Garbage>,
    angle_rad: f64,
    events: usize,
    /// The observer has ended the replay.
    is_stopped: bool,
}

impl<'a> Replayer<'a> {
    fn new(session: &'a RecoveredSession, state: RecoveredState, start: usize) -> Self {
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
    fn play(
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
        let rows = self.rows.as_ref()?;
        let recorded_rad = *rows.targets_rad.get(rows.next.checked_sub(1)?)?;
        let replayed_rad = Sample { theta_m_rad: target_rad, ..Sample::default() }.rounded().theta_m_rad;
        (recorded_rad != replayed_rad).then_some((recorded_rad, replayed_rad))
    }

    fn rows_are_left(&self) -> bool {
        self.rows.as_ref().is_some_and(|rows| rows.next < rows.samples.len())
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
        } else if self.rows.is_some() {
            self.row()?
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

    fn row(&mut self) -> Option<Reading> {
        // By the first rules, the sample that ended a record was not in it.
        let lacks_last = self.session.rules < 2;
        let rows = self.rows.as_mut()?;
        let place = rows.next;
        rows.next += 1;
        if let Some((_, fault)) = rows.breaks.filter(|(breaks, _)| *breaks == place) {
            return Some(Reading::Fault(fault));
        }
        let last = rows.samples.last().filter(|_| lacks_last && place == rows.samples.len());
        rows.samples.get(place).or(last).map(|sample| Reading::Sample(*sample))
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
        if let Some(rows) = self.rows.take()
            && rows.next < rows.samples.len()
        {
            let recorded = format!("{} more samples", rows.samples.len() - rows.next);
            let replayed = describe(&transition);
            return Ok(Some(self.difference(self.machine.sample() - 1, recorded, replayed)));
        }
        if let Some(file) = self.state.open.clone() {
            debug_assert_ne!(output.record, RecordTarget::None);
            self.rows = Some(self.read(&file)?);
        }
        Ok(None)
    }

    /// The samples of a record, all but the first, which is the one that it began with.
    fn read(&mut self, file: &str) -> Result<RecordedSamples, DatasetError> {
        let folder = &self.session.folder;
        let part = part_of(file);
        let is_part = folder.folder().contains(&part);
        let file = if is_part { &part } else { file };
        let text = folder.text(file, limits::RECORD_BYTES, None)?;
        let name = folder.name(file);
        // A record that is still being written may end in the middle of a row.
        let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
        if whole.len() < text.len() {
            let bytes = (text.len() - whole.len()) as u64;
            self.garbage.push(Garbage { file: name.clone(), bytes, is_torn_end: is_part });
        }
        if whole.is_empty() {
            return Ok(RecordedSamples { next: 0, ..RecordedSamples::default() });
        }
        let record = trial_csv_reader::parse(&name, whole, self.session.settings.sample_rate_hz)?;
        let is_rig_trial = header_of_file(file) == RIG_HEADER;
        let emg_mvc = |channel: &Option<Vec<f64>>, row: usize| channel.as_ref().map(|emg| emg[row]);
        let samples: Vec<Sample> = (0..record.theta_m_rad.len())
            .map(|row| Sample {
                theta_m_rad: record.theta_m_rad[row],
                torque_l_nm: record.torque_l_nm[row],
                emg_fcr_mvc: emg_mvc(&record.emg_fcr_mvc, row),
                emg_ecr_mvc: emg_mvc(&record.emg_ecr_mvc, row),
                further: FurtherChannel::ALL.map(|channel| Some(record.further(channel)?[row])),
            })
            .collect();
        let targets_rad =
            if is_rig_trial { trial_csv_reader::parse_targets(&name, whole)? } else { Vec::new() };
        let mut monitor = LimitMonitor::new((&self.limits).into(), self.session.settings.sample_rate_hz);
        let breaks = samples
            .iter()
            .enumerate()
            .find_map(|(place, sample)| monitor.check_sample(sample).err().map(|fault| (place, fault)));
        Ok(RecordedSamples { samples, targets_rad, next: 1, breaks })
    }
}

fn expected(due: &[ExpectedStep]) -> (Option<TransitionRecord>, Option<Event>) {
    let mut step = (None, None);
    for line in due {
        match line.record {
            StepEntry::Transition(transition) => step.0 = Some(transition),
            StepEntry::Refused(command) => step.1 = Some(command),
        }
    }
    step
}

fn describe_line(record: &StepEntry) -> String {
    match record {
        StepEntry::Transition(transition) => describe_step(Some(*transition), None),
        StepEntry::Refused(command) => describe_step(None, Some(*command)),
    }
}

fn describe_step(transition: Option<TransitionRecord>, refused: Option<Event>) -> String {
    match (transition, refused) {
        (None, None) => "nothing".to_owned(),
        (Some(transition), None) => describe(&transition),
        (None, Some(command)) => format!("{} refused", command.name()),
        (Some(transition), Some(command)) => format!("{}, {} refused", describe(&transition), command.name()),
    }
}

fn describe(transition: &TransitionRecord) -> String {
    let mut text = format!("{} to {}", transition.event.name(), transition.to.name());
    if let Some(detail) = transition.detail {
        // Made by this program, so it has a JSON form.
        text += &format!(" {}", serde_json::to_string(&detail).unwrap_or_default());
    }
    text
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

#[cfg(test)]
mod tests;
