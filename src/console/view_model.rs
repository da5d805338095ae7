//! Builds the snapshots and the history that pages draw from the session's steps. Readers get the latest snapshot only, so
//! that a slow page misses some and delays nobody.

use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::watch;

use super::command_questions::CommandQuestions;
use super::fitter::Fitter;
use super::history::{LogEntry, SessionHistory, SystemStatus};
use super::ramps::Ramps;
use super::reflexes::Reflexes;
use super::snapshot::{CurrentTrial, Instruction, PlaybackState, RigTrialsView, Snapshot};
use super::step_feed::TimedStep;
use super::strip_chart::{Bin, StripChart};
use super::time_left::time_left_s;
use super::trial_fits::TrialFits;
use crate::dataset::{AuditEntry, MemoryRecorder, OperatorAction, Trial};
use crate::protocol::SEAT_SUBJECT;
use crate::rig::{Cue, Direction};
use crate::session::{
    Attempt, Event, Phase, Progress, RecordTarget, Settings, Status, Step, StepConsumer, TransitionDetail,
    transitions::Guard,
};

/// Torque of a strong effort as a multiple of the largest target: the full scale of the display without a target.
const EFFORT_SCALE_TARGETS: f64 = 5.0;

/// Read access to the snapshots, the history and the strip charts.
#[derive(Debug, Clone)]
pub struct Views {
    snapshot: watch::Receiver<Arc<Snapshot>>,
    history: watch::Receiver<Arc<str>>,
    ramps: watch::Receiver<Arc<str>>,
    strip_chart: Arc<Mutex<StripChart>>,
}

impl Views {
    /// Receiver of the latest snapshot.
    pub fn snapshot(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.snapshot.clone()
    }

    /// Receiver of the latest history, as JSON.
    pub fn history(&self) -> watch::Receiver<Arc<str>> {
        self.history.clone()
    }

    /// Receiver of the last ramps of each condition, as JSON.
    pub fn ramps(&self) -> watch::Receiver<Arc<str>> {
        self.ramps.clone()
    }

    /// The complete bins of the strip charts from number `next` on, and the number of the bin after them.
    pub fn bins_since(&self, next: u64) -> (Vec<Bin>, u64) {
        self.strip_chart.lock().unwrap_or_else(PoisonError::into_inner).since(next)
    }
}

/// Follows a session step by step and publishes what pages show of it.
#[derive(Debug)]
pub struct ViewModel {
    settings: Arc<Settings>,
    /// Progress of the session, followed from the steps.
    progress: Progress,
    /// Records the trial under way for the fit.
    recorder: MemoryRecorder,
    fitter: Fitter,
    fits: TrialFits,
    ramps: Ramps,
    reflexes: Reflexes,
    questions: CommandQuestions,
    snapshot: Snapshot,
    /// Sample at which the phase was entered.
    phase_start: u64,
    /// Sample of the last step received.
    last_sample: u64,
    /// Whether a step of the trial under way was missed.
    has_gap: bool,
    /// Whether only recorded samples are drawn: a replay makes up the others.
    draws_records_only: bool,
    history: SessionHistory,
    history_changed: bool,
    /// Time before the start of the session that is being played, s.
    before_s: f64,
    strip_chart: Arc<Mutex<StripChart>>,
    snapshot_out: watch::Sender<Arc<Snapshot>>,
    history_out: watch::Sender<Arc<str>>,
    ramps_out: watch::Sender<Arc<str>>,
}

impl ViewModel {
    /// A session of which `progress` is already done.
    pub fn new(
        settings: Arc<Settings>,
        progress: Progress,
        fitter: Fitter,
        questions: CommandQuestions,
        playback: Option<PlaybackState>,
    ) -> (Self, Views) {
        let snapshot = Snapshot::before_start(playback);
        let strip_chart = Arc::new(Mutex::new(StripChart::default()));
        let (snapshot_out, snapshot_in) = watch::channel(Arc::new(snapshot.clone()));
        let (history_out, history_in) = watch::channel(Arc::from("null"));
        let (ramps_out, ramps_in) = watch::channel(Arc::from("null"));
        let views = Views {
            snapshot: snapshot_in,
            history: history_in,
            ramps: ramps_in,
            strip_chart: strip_chart.clone(),
        };
        let mut view = Self {
            progress,
            recorder: MemoryRecorder::new(settings.clone()),
            settings,
            fitter,
            fits: TrialFits::default(),
            ramps: Ramps::default(),
            reflexes: Reflexes::default(),
            questions,
            snapshot,
            phase_start: 0,
            last_sample: 0,
            has_gap: false,
            draws_records_only: playback.is_some(),
            history: SessionHistory::default(),
            history_changed: true,
            before_s: 0.0,
            strip_chart,
            snapshot_out,
            history_out,
            ramps_out,
        };
        view.count_trials();
        view.publish();
        (view, views)
    }

    /// Fits trials that were measured before.
    pub fn fit(&mut self, trials: impl IntoIterator<Item = Trial>) {
        for trial in trials {
            let number = trial.number;
            if trial.status == crate::dataset::Status::Ok {
                self.ramps.add(&trial, self.settings.sample_rate_hz);
                self.reflexes.add(&trial, self.settings.sample_rate_hz);
                self.history_changed = true;
            }
            if self.fitter.fit(trial) {
                self.fits.await_trial(number);
            }
        }
        self.publish_ramps();
    }

    /// Whether the fit of a trial is still under way.
    pub fn awaits_fits(&mut self) -> bool {
        self.collect_fits();
        self.fits.are_awaited()
    }

    fn publish_ramps(&self) {
        self.ramps_out.send_replace(self.ramps.json(self.fitter.window_s()).into());
    }

    fn collect_fits(&mut self) {
        while let Some(outcome) = self.fitter.outcome() {
            self.fits.add(outcome);
            self.history_changed = true;
        }
    }

    /// Starts again from `progress`, `before_s` after the beginning of the recording: the recorded session was resumed there.
    pub fn restart(&mut self, progress: Progress, before_s: f64) {
        self.recorder = MemoryRecorder::new(self.settings.clone());
        self.progress = progress;
        let n = self.snapshot.subject.n;
        self.snapshot = Snapshot::before_start(self.snapshot.playback);
        self.snapshot.subject.n = n;
        (self.phase_start, self.last_sample, self.before_s) = (0, 0, before_s);
        self.count_trials();
        self.history_changed = true;
    }

    /// Goes back to the beginning of the recording and empties the history.
    pub fn rewind(&mut self, progress: Progress) {
        self.restart(progress, 0.0);
        self.history = SessionHistory::default();
        self.strip_chart.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// Sets the state of the playback; returns whether more than its position changed.
    pub fn set_playback(&mut self, playback: PlaybackState) -> bool {
        let before = self.snapshot.playback.replace(playback);
        before.map(|before| PlaybackState { position_s: playback.position_s, ..before }) != Some(playback)
    }

    /// Takes a step of the session.
    pub fn take(&mut self, timed: &TimedStep) {
        let step = &timed.step;
        // A replay passes over pauses, and misses nothing.
        let missed =
            if self.draws_records_only { 0 } else { step.sample.saturating_sub(self.last_sample + 1) };
        self.snapshot.missed_steps += missed;
        self.has_gap |= missed > 0;
        self.last_sample = step.sample;
        self.snapshot.t_s = self.time_s(step.sample);
        if step.phase != self.snapshot.phase {
            self.phase_start = step.sample;
        }
        self.snapshot.phase = step.phase;
        self.snapshot.measured = Some(timed.at);
        if let Some(transition) = &step.transition {
            self.progress.apply(transition);
        }
        let Ok(()) = self.recorder.consume(step, &self.progress);
        let measures = !self.draws_records_only || step.record != RecordTarget::None;
        if measures {
            self.strip_chart.lock().unwrap_or_else(PoisonError::into_inner).take(self.snapshot.t_s, step);
        }
        self.show(step, measures);
        if let Some(transition) = step.transition {
            self.history.add_transition(self.snapshot.t_s, &transition, &self.progress);
            self.history_changed = true;
            if transition.to == Phase::Hold {
                self.has_gap = false;
            }
            if matches!(transition.event, Event::HoldOver) {
                self.fit_last_trial();
            }
            if let Some(TransitionDetail::TakenBack { number }) = transition.detail
                && !self.progress.rig_trials_due()
            {
                self.fitter.forget(number);
                self.ramps.remove(number);
                self.reflexes.remove(number);
                self.publish_ramps();
            }
        }
        if let Some(command) = step.refused {
            self.history.add(self.snapshot.t_s, LogEntry::refused(command, step.phase));
            self.history_changed = true;
        }
    }

    /// Adds an operator's action to the history.
    pub fn add_action(&mut self, entry: &AuditEntry) {
        let t_s = self.time_s(entry.sample);
        if matches!(entry.action, OperatorAction::RequestedPauseAfterTrial | OperatorAction::Missed { .. }) {
            self.snapshot.pause_requested = true;
        }
        self.history.add(t_s, LogEntry::of_action(entry));
        self.history_changed = true;
    }

    /// Adds an alarm to the history.
    pub fn add_alarm(&mut self, text: &str) {
        self.history.add(self.snapshot.t_s, LogEntry::alarm(text));
        self.history_changed = true;
    }

    /// Adds a plain message to the history.
    pub fn add_message(&mut self, text: &str) {
        self.history.add(self.snapshot.t_s, LogEntry::plain(text));
        self.history_changed = true;
    }

    /// Sets the timing, disk space and display latency.
    pub fn set_status(&mut self, status: SystemStatus) {
        self.history_changed |= self.history.set_status(self.snapshot.t_s, status);
    }

    /// Marks the session as over, with a closing message for the log. A fit that is still under way is given up.
    pub fn close(&mut self, message: &str) {
        self.collect_fits();
        self.fits.give_up("the session was over before its fit; see the fit at the end of the session");
        self.snapshot.is_over = true;
        self.history.add(self.snapshot.t_s, LogEntry::plain(message));
        self.history_changed = true;
    }

    /// Publishes a snapshot, and the history if it changed.
    pub fn publish(&mut self) {
        self.collect_fits();
        let progress = &self.progress;
        let snapshot = &mut self.snapshot;
        snapshot.subject.n += 1;
        snapshot.in_phase_s =
            (self.last_sample.saturating_sub(self.phase_start)) as f64 / self.settings.sample_rate_hz;
        snapshot.time_left_s = (!snapshot.phase.is_final())
            .then(|| time_left_s(progress, &self.settings, snapshot.phase, snapshot.in_phase_s));
        if self.history_changed {
            let possible = |command: &Event| progress.line(snapshot.phase, *command).is_some();
            let commands = Event::COMMANDS.iter().filter(|command| possible(command));
            snapshot.possible = if snapshot.playback.is_some() {
                Vec::new()
            } else {
                commands.map(|command| command.name()).collect()
            };
            snapshot.questions = self.questions.now(snapshot.phase, progress);
            snapshot.pause_requested =
                (snapshot.pause_requested && snapshot.phase.is_armed() && snapshot.phase != Phase::Paused)
                    || progress.holds(Guard::PauseAsked);
            self.history_changed = false;
            let history = self.history.json(progress, &self.settings, &self.fits, &self.reflexes);
            self.history_out.send_replace(history.into());
        }
        self.snapshot_out.send_replace(Arc::new(snapshot.clone()));
        // A snapshot without a new sample must not count in the display latency.
        self.snapshot.measured = None;
    }

    fn time_s(&self, sample: u64) -> f64 {
        self.before_s + sample as f64 / self.settings.sample_rate_hz
    }

    fn fit_last_trial(&mut self) {
        let Some(trial) = self.recorder.take_last_trial(&self.progress) else { return };
        if self.has_gap {
            let why = "the console missed some of its samples; see the fit at the end of the session";
            self.fits.add((trial.number, Err(why.to_owned())));
        } else if !self.fits.has(trial.number) {
            self.fit([trial]);
        }
    }

    /// Updates what subject and operator see.
    fn show(&mut self, step: &Step, measures: bool) {
        let snapshot = &mut self.snapshot;
        if measures {
            snapshot.angle_rad = step.measured.map_or(snapshot.angle_rad, |sample| sample.theta_m_rad);
            snapshot.torque_nm = step.feedback_torque_nm;
        }
        let shown = &mut snapshot.subject;
        shown.instruction = instruction(step);
        shown.band_fraction = self.settings.gate.band_fraction;
        // The display stands still while the motor moves.
        if shown.instruction != Instruction::Moving {
            shown.gate = step.gate_fraction;
            shown.emg_mvc = match measures {
                true => step.feedback_emg_mvc,
                false => shown.emg_mvc.map(|level| level.map(|_| 0.0)),
            };
            snapshot.target_nm = None;
            (shown.direction, shown.level) = match step.cue {
                Cue::Target { target_nm, .. } => {
                    snapshot.target_nm = Some(target_nm);
                    (Some(direction(target_nm)), step.feedback_torque_nm / target_nm)
                }
                Cue::Effort(direction) => {
                    let targets = self.settings.plan.iter().map(|planned| planned.torque_nm.abs());
                    let strong_nm = EFFORT_SCALE_TARGETS * targets.fold(0.1, f64::max);
                    (Some(direction), step.feedback_torque_nm.abs() / strong_nm)
                }
                _ => (None, 0.0),
            };
        }
        let rest_s = match step.phase {
            Phase::Rest => Some(self.settings.rest_samples as f64 / self.settings.sample_rate_hz),
            Phase::MvcRest => self.settings.mvc.as_ref().map(|mvc| mvc.rest_s),
            _ => None,
        };
        let rested_s = step.sample.saturating_sub(self.phase_start) as f64 / self.settings.sample_rate_hz;
        shown.rest_left_s = rest_s.map(|rest_s| (rest_s - rested_s).max(0.0));
        shown.rest_s = rest_s;
        if step.transition.is_some() {
            self.count_trials();
        }
    }

    /// Counts the trials and sets the one under way.
    fn count_trials(&mut self) {
        let progress = &self.progress;
        let snapshot = &mut self.snapshot;
        let (last, shown) = (progress.attempts().last(), &mut snapshot.subject);
        let measured = |attempt: &&Attempt| !attempt.planned.key.practice;
        let ended = progress.attempts().iter().filter(measured).filter_map(|attempt| attempt.ended);
        shown.done = ended.filter(|(status, _)| *status == Status::Ok).count();
        let under_way = progress.current().iter().filter(|attempt| measured(attempt)).count();
        let left = progress.queue().filter(|planned| !planned.key.practice).count();
        shown.total = shown.done + under_way + left;
        shown.last_counts = last.and_then(|attempt| attempt.ended).map(|(status, _)| status == Status::Ok);
        snapshot.trial = last.map(|attempt| CurrentTrial {
            number: attempt.number,
            practice: attempt.planned.key.practice,
            velocity_rad_s: attempt.planned.velocity_rad_s,
            repetition: attempt.planned.repetition,
            status: attempt.ended.map(|(status, _)| status),
        });
        snapshot.rig_trials = progress.rig_trials_due().then(|| rig_trials(progress, snapshot.phase));
    }
}

/// The rig trials as the operator sees them in `phase`.
fn rig_trials(progress: &Progress, phase: Phase) -> RigTrialsView {
    let statuses = progress.rig_attempts().iter().filter_map(|attempt| attempt.ended);
    let done = statuses.filter(|(status, _)| *status == Status::Ok).count();
    let current = progress.current_rig_trial();
    let asks = phase == Phase::RigSetup && !progress.holds(Guard::LoadMounted);
    RigTrialsView {
        done,
        total: done + progress.rig_queue().len() + usize::from(current.is_some()),
        current: current.map(|attempt| {
            let planned = &attempt.planned;
            format!("{}, {}, {}", planned.load.name(), planned.motion.name(), planned.repetition)
        }),
        instruction: asks.then(|| {
            let next = progress.rig_queue().next();
            let instruction = next.map_or(SEAT_SUBJECT.to_owned(), |planned| planned.load.instruction());
            format!("{instruction} Then resume.")
        }),
    }
}

fn instruction(step: &Step) -> Instruction {
    match (step.phase, step.cue) {
        (Phase::Finished, _) => Instruction::Done,
        (Phase::Ready | Phase::Aborted | Phase::RigSetup, _) | (_, Cue::RigTrial(_)) => Instruction::Wait,
        (Phase::Paused | Phase::Faulted | Phase::Homing, _) => Instruction::Pause,
        (Phase::Delay, _) => Instruction::Stay,
        (_, Cue::Relax) => Instruction::Relax,
        (_, Cue::Effort(_)) => Instruction::Effort,
        (_, Cue::Target { .. }) => Instruction::Target,
        (_, Cue::Moving) => Instruction::Moving,
        (_, Cue::Rest) => Instruction::Rest,
    }
}

fn direction(torque_nm: f64) -> Direction {
    if torque_nm < 0.0 { Direction::Extension } else { Direction::Flexion }
}
