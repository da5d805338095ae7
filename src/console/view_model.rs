//! Makes of the session's steps what pages draw, and hands it out: the latest picture alone, so that who is slow misses
//! some and delays nobody.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, PoisonError};

use tokio::sync::watch;

use super::fitter::{Fitter, TrialFitOutcome};
use super::history::{History, LogEntry, SystemStatus};
use super::snapshot::{CurrentTrial, Instruction, PlaybackState, Snapshot, SubjectView};
use super::step_feed::TimedStep;
use super::strip_chart::{Bin, StripChart};
use crate::dataset::{AuditEntry, MemoryRecorder, OperatorAction, Trial};
use crate::rig::{Cue, Direction};
use crate::session::{Attempt, Event, Phase, Progress, RecordTarget, Settings, Status, transitions::Guard};

/// A strong effort, in targets: the scale of the display while there is no target.
const STRONG_EFFORT: f64 = 5.0;

/// Where readers find what the hub made.
#[derive(Debug, Clone)]
pub struct Views {
    now: watch::Receiver<Arc<Snapshot>>,
    story: watch::Receiver<Arc<str>>,
    strip: Arc<Mutex<StripChart>>,
}

impl Views {
    /// The latest picture, and when there is a newer one.
    pub fn now(&self) -> watch::Receiver<Arc<Snapshot>> {
        self.now.clone()
    }

    /// The latest story, as JSON.
    pub fn story(&self) -> watch::Receiver<Arc<str>> {
        self.story.clone()
    }

    /// The bins of the strip charts from number `next` on, and the number after them.
    pub fn bins_since(&self, next: u64) -> (Vec<Bin>, u64) {
        self.strip.lock().unwrap_or_else(PoisonError::into_inner).since(next)
    }
}

/// The hub.
#[derive(Debug)]
pub struct ViewModel {
    settings: Arc<Settings>,
    /// Keeps the trial under way for the fit.
    records: MemoryRecorder,
    fitter: Fitter,
    fits: BTreeMap<u32, TrialFitOutcome>,
    now: Snapshot,
    /// Sample at which the phase was entered.
    entered: u64,
    /// Sample of the last step seen.
    seen: u64,
    /// A step of the trial under way was left out.
    has_gap: bool,
    /// Only what was recorded is drawn: the rest of a replay was made up.
    records_alone: bool,
    story: History,
    story_changed: bool,
    /// Time before the start of the session that is being played, s.
    before_s: f64,
    strip: Arc<Mutex<StripChart>>,
    now_out: watch::Sender<Arc<Snapshot>>,
    story_out: watch::Sender<Arc<str>>,
}

impl ViewModel {
    /// A session of which `progress` is already done.
    pub fn new(
        settings: Arc<Settings>,
        progress: Progress,
        fitter: Fitter,
        tape: Option<PlaybackState>,
    ) -> (Self, Views) {
        let now = waiting(tape);
        let strip = Arc::new(Mutex::new(StripChart::default()));
        let (now_out, now_in) = watch::channel(Arc::new(now.clone()));
        let (story_out, story_in) = watch::channel(Arc::from("null"));
        let views = Views { now: now_in, story: story_in, strip: strip.clone() };
        let mut hub = Self {
            records: MemoryRecorder::with_progress(settings.clone(), progress),
            settings,
            fitter,
            fits: BTreeMap::new(),
            now,
            entered: 0,
            seen: 0,
            has_gap: false,
            records_alone: tape.is_some(),
            story: History::default(),
            story_changed: true,
            before_s: 0.0,
            strip,
            now_out,
            story_out,
        };
        hub.count();
        hub.publish();
        (hub, views)
    }

    /// Has trials fitted that were measured earlier.
    pub fn fit(&self, trials: impl IntoIterator<Item = Trial>) {
        trials.into_iter().for_each(|trial| self.fitter.fit(trial));
    }

    /// The session begins anew, with `progress` already done: it was resumed, or is looked at from another place.
    pub fn restart(&mut self, progress: Progress, before_s: f64) {
        self.records = MemoryRecorder::with_progress(self.settings.clone(), progress);
        let n = self.now.shown.n;
        self.now = waiting(self.now.tape);
        self.now.shown.n = n;
        (self.entered, self.seen, self.before_s) = (0, 0, before_s);
        self.count();
        self.story_changed = true;
    }

    /// The recording is looked at from its beginning again: nothing has been told yet.
    pub fn rewind(&mut self, progress: Progress) {
        self.restart(progress, 0.0);
        self.story = History::default();
        self.strip.lock().unwrap_or_else(PoisonError::into_inner).clear();
    }

    /// How the recording is played; whether that is news.
    pub fn set_tape(&mut self, tape: PlaybackState) -> bool {
        self.now.tape.replace(tape) != Some(tape)
    }

    /// Takes a step in.
    pub fn take(&mut self, beat: &TimedStep) {
        let step = &beat.step;
        let missed = step.sample.saturating_sub(self.seen + 1);
        self.now.left_out += missed;
        self.has_gap |= missed > 0;
        self.seen = step.sample;
        self.now.t_s = self.time_s(step.sample);
        if beat.phase != self.now.phase {
            self.entered = step.sample;
        }
        self.now.phase = beat.phase;
        self.now.measured = Some(beat.at);
        self.records.keep_step(step);
        let measures = !self.records_alone || step.recording != RecordTarget::None;
        if measures {
            self.strip.lock().unwrap_or_else(PoisonError::into_inner).take(self.now.t_s, beat);
        }
        self.show(beat, measures);
        if let Some(happening) = step.happened {
            self.story.happened(self.now.t_s, &happening);
            self.story_changed = true;
            if happening.to == Phase::Hold {
                self.has_gap = false;
            }
            if matches!(happening.event, Event::HoldOver) {
                self.fit_last();
            }
        }
        if let Some(word) = step.refused {
            self.story.tell(self.now.t_s, LogEntry::refused(word, beat.phase));
            self.story_changed = true;
        }
    }

    /// What was done at a console.
    pub fn remark(&mut self, remark: &AuditEntry) {
        let t_s = self.time_s(remark.sample);
        if matches!(remark.deed, OperatorAction::AskedForPauseAfterTrial | OperatorAction::Missed { .. }) {
            self.now.pause_asked = true;
        }
        self.story.tell(t_s, LogEntry::of(remark));
        self.story_changed = true;
    }

    /// Something that the operator must know.
    pub fn alarm(&mut self, text: &str) {
        self.story.tell(self.now.t_s, LogEntry::alarm(text));
        self.story_changed = true;
    }

    /// How everything fares.
    pub fn gauge(&mut self, gauges: SystemStatus) {
        self.story_changed |= self.story.gauge(gauges);
    }

    /// The program is done with the session.
    pub fn over(&mut self, said: &str) {
        self.now.is_over = true;
        self.story.tell(self.now.t_s, LogEntry::plain(said));
        self.story_changed = true;
    }

    /// Hands out what is new.
    pub fn publish(&mut self) {
        while let Some(outcome) = self.fitter.outcome() {
            self.fits.insert(outcome.0, outcome);
            self.story_changed = true;
        }
        let progress = self.records.progress();
        let now = &mut self.now;
        now.shown.n += 1;
        now.in_phase_s = (self.seen.saturating_sub(self.entered)) as f64 / self.settings.sample_rate_hz;
        if self.story_changed {
            let possible = |word: &Event| progress.line(now.phase, *word).is_some();
            let words = WORDS.iter().filter(|word| possible(word));
            now.possible =
                if now.tape.is_some() { Vec::new() } else { words.map(|word| word.name()).collect() };
            now.pause_asked = (now.pause_asked && now.phase.is_armed() && now.phase != Phase::Paused)
                || progress.holds(Guard::PauseAsked);
            self.story_changed = false;
            self.story_out.send_replace(self.story.json(progress, &self.settings, &self.fits).into());
        }
        self.now_out.send_replace(Arc::new(now.clone()));
        // A picture that is made again, for want of a new sample, does not tell how old samples are.
        self.now.measured = None;
    }

    fn time_s(&self, sample: u64) -> f64 {
        self.before_s + sample as f64 / self.settings.sample_rate_hz
    }

    fn fit_last(&mut self) {
        let Some(trial) = self.records.take_last_trial() else { return };
        if self.has_gap {
            let why = "some of its samples were left out on the way here; see the fit at the end";
            self.fits.insert(trial.number, (trial.number, Err(why.to_owned())));
        } else if !self.fits.contains_key(&trial.number) {
            self.fitter.fit(trial);
        }
    }

    /// What the person sees, and what the operator sees of it.
    fn show(&mut self, beat: &TimedStep, measures: bool) {
        let now = &mut self.now;
        if measures {
            now.angle_rad = beat.step.measured.map_or(now.angle_rad, |sample| sample.theta_m_rad);
            now.torque_nm = beat.shown_nm;
        }
        let shown = &mut now.shown;
        shown.cue = asked(beat);
        shown.band_fraction = self.settings.gate.band_fraction;
        // While the motor moves, nothing on the display does.
        if shown.cue != Instruction::Moving {
            shown.gate = beat.gate;
            shown.emg_mvc = if measures { beat.emg_mvc } else { [0.0; 2] };
            now.target_nm = None;
            (shown.direction, shown.level) = match beat.cue {
                Cue::Target { target_nm, .. } => {
                    now.target_nm = Some(target_nm);
                    (Some(direction(target_nm)), beat.shown_nm / target_nm)
                }
                Cue::Effort(direction) => {
                    let targets = self.settings.plan.iter().map(|planned| planned.torque_nm.abs());
                    let strong_nm = STRONG_EFFORT * targets.fold(0.1, f64::max);
                    (Some(direction), beat.shown_nm.abs() / strong_nm)
                }
                _ => (None, 0.0),
            };
        }
        let rest_s = match beat.phase {
            Phase::Rest => Some(self.settings.rest_samples as f64 / self.settings.sample_rate_hz),
            Phase::MvcRest => self.settings.mvc.as_ref().map(|mvc| mvc.rest_s),
            _ => None,
        };
        let rested_s = beat.step.sample.saturating_sub(self.entered) as f64 / self.settings.sample_rate_hz;
        shown.rest_left_s = rest_s.map(|rest_s| (rest_s - rested_s).max(0.0));
        shown.rest_s = rest_s;
        if beat.step.happened.is_some() {
            self.count();
        }
    }

    /// How many trials are done, and which is under way.
    fn count(&mut self) {
        let progress = self.records.progress();
        let now = &mut self.now;
        let (last, shown) = (progress.attempts().last(), &mut now.shown);
        let measured = |attempt: &&Attempt| !attempt.planned.key.practice;
        let ended = progress.attempts().iter().filter(measured).filter_map(|attempt| attempt.ended);
        shown.done = ended.filter(|(status, _)| *status == Status::Ok).count();
        let under_way = progress.current().iter().filter(|attempt| measured(attempt)).count();
        let left = progress.queue().filter(|planned| !planned.key.practice).count();
        shown.total = shown.done + under_way + left;
        shown.last_counts = last.and_then(|attempt| attempt.ended).map(|(status, _)| status == Status::Ok);
        now.trial = last.map(|attempt| CurrentTrial {
            number: attempt.number,
            practice: attempt.planned.key.practice,
            velocity_rad_s: attempt.planned.velocity_rad_s,
            repetition: attempt.planned.repetition,
            status: attempt.ended.map(|(status, _)| status),
        });
    }
}

/// The operator's words.
const WORDS: [Event; 7] =
    [Event::Start, Event::Pause, Event::Resume, Event::Skip, Event::Repeat, Event::Abort, Event::Rearm];

fn asked(beat: &TimedStep) -> Instruction {
    match (beat.phase, beat.cue) {
        (Phase::Finished, _) => Instruction::Done,
        (Phase::Ready | Phase::Aborted, _) => Instruction::Wait,
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

/// Before the first step.
pub(super) fn waiting(tape: Option<PlaybackState>) -> Snapshot {
    Snapshot {
        shown: SubjectView {
            n: 0,
            cue: Instruction::Wait,
            direction: None,
            level: 0.0,
            band_fraction: 0.0,
            emg_mvc: [0.0; 2],
            gate: 0.0,
            rest_left_s: None,
            rest_s: None,
            done: 0,
            total: 0,
            last_counts: None,
        },
        t_s: 0.0,
        phase: Phase::Ready,
        in_phase_s: 0.0,
        angle_rad: 0.0,
        torque_nm: 0.0,
        target_nm: None,
        trial: None,
        possible: Vec::new(),
        pause_asked: false,
        left_out: 0,
        is_over: false,
        measured: None,
        tape,
    }
}
