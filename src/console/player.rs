//! Playback of a recorded session in the pages: its records go through the state machine again, at the requested speed.
//!
//! To seek, the playback starts again and runs to the requested time without drawing.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::command_questions::CommandQuestions;
use super::controls::{Controls, Request};
use super::display_latency::DisplayLatencies;
use super::error::ConsoleError;
use super::fitter::{Fitter, TrialFitContext};
use super::playback_time::{PlaybackTime, duration_text};
use super::snapshot::PlaybackState;
use super::step_feed::TimedStep;
use super::thread_priority::lower_thread_priority;
use super::view_model::{ViewModel, Views};
use super::web::{Address, PageAddresses, PageContent, Server, SessionContent};
use super::welcome::{SessionInfo, welcome_messages};
use crate::dataset::{self, ActionOrigin, AuditEntry, JOURNAL, OperatorAction, Wrist, replay_watched};
use crate::fit::PreprocessingSettings;
use crate::session::{Machine, Progress, Settings, Step};

/// Time between two snapshots.
const PLAYBACK_SNAPSHOT_PERIOD: Duration = Duration::from_millis(5);
/// Time between two checks for a request while the recording is paused.
const PAUSED_POLL: Duration = Duration::from_millis(10);
/// Time between two snapshots while the recording is paused.
const PAUSED_SNAPSHOT_PERIOD: Duration = Duration::from_millis(500);
/// Lowest and highest speed of the playback, relative to real time.
const SPEEDS: [f64; 2] = [0.05, 1000.0];

/// A recorded session as read before the playback.
struct RecordedSession {
    folder: PathBuf,
    settings: Arc<Settings>,
    info: SessionInfo,
    wrist: Wrist,
    /// Time before each start of the session, s.
    before_s: Vec<f64>,
    /// Length as it is played, s.
    length_s: f64,
    /// Operators' actions, each with the number of its start of the session, from 0.
    actions: Vec<(usize, AuditEntry)>,
}

impl RecordedSession {
    /// Reads the session and replays it once.
    fn read(folder: &Path, wrist: Option<Wrist>) -> Result<(Self, ViewModel, Views), ConsoleError> {
        let session = dataset::load(folder)?;
        if !dataset::open_session(folder)?.contains(JOURNAL) {
            return Err(ConsoleError::Foreign(folder.to_owned()));
        }
        let protocol =
            dataset::stored_protocol(folder)?.ok_or_else(|| ConsoleError::Foreign(folder.to_owned()))?;
        let actions: Vec<_> =
            dataset::operator_actions(folder)?.into_iter().map(|(start, entry)| (start - 1, entry)).collect();
        let (mut settings, mut time) = (None, PlaybackTime::default());
        let (mut before, mut sample, mut starts) = (0, 0, Vec::new());
        replay_watched(folder, &mut |_, machine| {
            if machine.sample() == 1 {
                before += sample;
                starts.push(before);
            }
            sample = machine.sample();
            let settings = settings.get_or_insert_with(|| machine.settings().clone());
            time.takes(machine.phase(), sample, settings.sample_rate_hz);
            ControlFlow::Continue(())
        })?;
        let mut settings = settings.ok_or_else(|| ConsoleError::Empty(folder.to_owned()))?;
        // A replay runs without limits; the pages show those of the protocol.
        settings.limits = protocol.limits.clone();
        let rate_hz = settings.sample_rate_hz;
        let opened = actions.iter().find_map(|(_, entry)| match entry.action {
            OperatorAction::Opened { wrist } => Some(wrist),
            _ => None,
        });
        let recording = Self {
            folder: folder.to_owned(),
            info: SessionInfo {
                protocol: protocol.name.clone(),
                subject: session.subject.id.clone(),
                folder: folder.display().to_string(),
                rig: "recording".to_owned(),
            },
            wrist: wrist.or(opened).unwrap_or_default(),
            before_s: starts.iter().map(|samples| *samples as f64 / rate_hz).collect(),
            length_s: time.position_s(rate_hz),
            settings: Arc::new(settings),
            actions,
        };
        let fitter = Fitter::start(TrialFitContext {
            subject: session.subject.id,
            sample_rate_hz: session.sample_rate_hz,
            lever: session.lever,
            recorded_filter: session.recorded_filter,
            preprocessing: PreprocessingSettings::of(&protocol),
        });
        let progress = Progress::new(&recording.settings);
        let playback =
            PlaybackState { speed: 1.0, is_playing: false, position_s: 0.0, length_s: recording.length_s };
        let (mut view, views) = ViewModel::new(
            recording.settings.clone(),
            progress,
            fitter,
            CommandQuestions::default(),
            Some(playback),
        );
        view.fit(session.trials);
        Ok((recording, view, views))
    }
}

/// The latest requests to the player.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PlaybackRequest {
    speed: f64,
    plays: bool,
    /// Time to go to as the recording is played, s.
    seek: Option<f64>,
    over: bool,
}

/// The operator's requests to the player.
#[derive(Debug, Clone)]
struct PlaybackControls(Arc<Mutex<PlaybackRequest>>);

impl PlaybackControls {
    fn current(&self) -> PlaybackRequest {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut PlaybackRequest)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Controls for PlaybackControls {
    fn request(&self, request: Request, _: ActionOrigin) {
        match request {
            Request::Play { speed, plays } if speed.is_finite() => {
                let [slowest, fastest] = SPEEDS;
                self.change(|requested| {
                    (requested.speed, requested.plays) = (speed.clamp(slowest, fastest), plays)
                });
            }
            Request::Seek { t_s } if t_s.is_finite() => {
                self.change(|requested| requested.seek = Some(t_s.max(0.0)))
            }
            // The others are commands for a running session.
            _ => {}
        }
    }
}

/// Plays a recorded session in the pages until it is dropped.
pub struct Playback {
    controls: PlaybackControls,
    player: Option<JoinHandle<()>>,
    server: Server,
}

impl Playback {
    /// Opens the pages of the session in `folder`; `wrist` overrides what was recorded.
    ///
    /// # Errors
    /// If the session cannot be read or the pages cannot be served.
    pub fn open(folder: &Path, address: &Address, wrist: Option<Wrist>) -> Result<Self, ConsoleError> {
        let (recording, view, views) = RecordedSession::read(folder, wrist)?;
        let playback = views.snapshot().borrow().playback;
        let requested = PlaybackRequest { speed: 1.0, plays: false, seek: None, over: false };
        let controls = PlaybackControls(Arc::new(Mutex::new(requested)));
        let content = PageContent::Session(SessionContent {
            welcome: welcome_messages(&recording.info, &recording.settings, recording.wrist, playback),
            views,
            controls: Arc::new(controls.clone()),
            latencies: DisplayLatencies::default(),
        });
        let server = Server::start(address, content)?;
        let player = Player {
            recording,
            view,
            controls: controls.clone(),
            start: 0,
            actions_shown: 0,
            time: PlaybackTime::default(),
            anchor: None,
            published: Instant::now(),
            seek_to_s: 0.0,
            is_interrupted: false,
        };
        let player = thread::Builder::new()
            .name("player".to_owned())
            .spawn(move || player.play())
            .map_err(ConsoleError::Start)?;
        Ok(Self { controls, player: Some(player), server })
    }

    /// Addresses of the pages.
    pub fn pages(&self) -> PageAddresses {
        self.server.pages()
    }
}

impl Drop for Playback {
    fn drop(&mut self) {
        self.controls.change(|requested| requested.over = true);
        if let Some(player) = self.player.take() {
            // If the thread panicked, there is nothing left to show.
            let _ = player.join();
        }
    }
}

/// Plays a recording.
struct Player {
    recording: RecordedSession,
    view: ViewModel,
    controls: PlaybackControls,
    /// Number of the start of the session that is being played, from 1; 0 before the first.
    start: usize,
    /// Number of operators' actions shown so far.
    actions_shown: usize,
    /// Time in the recording as it is played.
    time: PlaybackTime,
    /// Reference for the pace: wall-clock time, time in the recording as it is played in s, and speed.
    anchor: Option<(Instant, f64, f64)>,
    published: Instant,
    /// Time in the recording up to which nothing is drawn, s.
    seek_to_s: f64,
    /// Whether the replay was stopped by a seek or by the end of the playback.
    is_interrupted: bool,
}

impl Player {
    /// Runs until the playback is dropped.
    fn play(mut self) {
        lower_thread_priority();
        while !self.controls.current().over {
            let folder = self.recording.folder.clone();
            (self.start, self.actions_shown, self.anchor, self.is_interrupted) = (0, 0, None, false);
            self.time = PlaybackTime::default();
            self.view.rewind(Progress::new(&self.recording.settings));
            let played = replay_watched(&folder, &mut |step, machine| {
                if machine.sample() == 1 {
                    let before_s = self.recording.before_s.get(self.start).copied().unwrap_or(0.0);
                    self.start += 1;
                    // The first step starts the session and changes no progress.
                    self.view.restart(machine.progress().clone(), before_s);
                }
                self.play_step(step, machine)
            });
            match played {
                Ok(replay) => {
                    if let Some(difference) = &replay.difference {
                        self.view.add_alarm(&format!(
                            "from here on the replay differs from the record: {difference}"
                        ));
                    }
                }
                Err(error) => self.view.add_alarm(&error.to_string()),
            }
            if !self.is_interrupted {
                self.wait_at_end();
            }
        }
    }

    /// Shows a step with the operators' actions before it, and waits until the next step is due. The end of a long pause is
    /// shown at once.
    fn play_step(&mut self, step: &Step, machine: &Machine) -> ControlFlow<()> {
        let (sample, rate_hz) = (machine.sample(), machine.settings().sample_rate_hz);
        self.add_due_actions(sample - 1);
        let pause_s = self.time.shortened_pause_s(sample, rate_hz);
        let is_played = self.time.takes(machine.phase(), sample, rate_hz);
        if !is_played && !step.is_journaled() {
            return ControlFlow::Continue(());
        }
        self.view.take(&TimedStep::now(step));
        self.add_due_actions(sample);
        if let Some(pause_s) = pause_s.filter(|_| is_played) {
            let lasted = duration_text(pause_s);
            self.view.add_message(&format!("the pause lasted {lasted}; only its beginning is played"));
        }
        self.keep_pace(self.time.position_s(rate_hz))
    }

    /// Waits until the step at `t_s` in the recording as it is played is due.
    fn keep_pace(&mut self, t_s: f64) -> ControlFlow<()> {
        if t_s < self.seek_to_s {
            return ControlFlow::Continue(());
        }
        loop {
            let requested = self.controls.current();
            if requested.over || requested.seek.is_some() {
                self.restart(requested);
                return ControlFlow::Break(());
            }
            if !requested.plays {
                self.anchor = None;
                self.publish_if_due(requested, PAUSED_SNAPSHOT_PERIOD);
                thread::sleep(PAUSED_POLL);
                continue;
            }
            let (then, there_s, speed) = *self.anchor.get_or_insert((Instant::now(), t_s, requested.speed));
            if speed != requested.speed {
                self.anchor = None;
                continue;
            }
            let due = Duration::from_secs_f64((t_s - there_s).max(0.0) / speed);
            let ahead = due.saturating_sub(then.elapsed());
            self.publish_if_due(requested, PLAYBACK_SNAPSHOT_PERIOD);
            if ahead < PLAYBACK_SNAPSHOT_PERIOD / 2 {
                return ControlFlow::Continue(());
            }
            thread::sleep(ahead.min(PAUSED_POLL));
        }
    }

    fn add_due_actions(&mut self, sample: u64) {
        while let Some((start, entry)) = self.recording.actions.get(self.actions_shown) {
            let is_due = (*start + 1, entry.sample) <= (self.start, sample);
            if !is_due {
                return;
            }
            self.view.add_action(entry);
            self.actions_shown += 1;
        }
    }

    /// Publishes a snapshot, unless the last one is newer than `pause`.
    fn publish_if_due(&mut self, requested: PlaybackRequest, pause: Duration) {
        let playback = PlaybackState {
            speed: requested.speed,
            is_playing: requested.plays,
            position_s: self.time.position_s(self.recording.settings.sample_rate_hz),
            length_s: self.recording.length_s,
        };
        let changed = self.view.set_playback(playback);
        if changed || self.published.elapsed() >= pause {
            self.view.publish();
            self.published = Instant::now();
        }
    }

    fn restart(&mut self, requested: PlaybackRequest) {
        self.is_interrupted = true;
        // Just before the end, so that there is a step to show.
        self.seek_to_s = requested.seek.unwrap_or(0.0).min(self.recording.length_s - 0.001);
        self.controls.change(|now| now.seek = now.seek.filter(|seek| Some(*seek) != requested.seek));
    }

    /// Waits at the end of the recording for a request.
    fn wait_at_end(&mut self) {
        self.controls.change(|requested| requested.plays = false);
        loop {
            let requested = self.controls.current();
            self.publish_if_due(requested, PAUSED_SNAPSHOT_PERIOD);
            if requested.over || requested.seek.is_some() || requested.plays {
                return self.restart(requested);
            }
            thread::sleep(PAUSED_POLL);
        }
    }
}
