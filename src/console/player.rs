//! A recorded session in the same pages: its records go through the state machine again, at a pace that is asked for.
//!
//! To go to another place is to begin anew and to run there without drawing; so whatever is shown is what was so then.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::fitter::{Fitter, TrialFitContext};
use super::live::PageAddresses;
use super::snapshot::PlaybackState;
use super::view_model::ViewModel;
use super::web::{Address, Content, Role, Server};
use super::welcome::{SessionInfo, hello};
use super::{ConsoleError, Controls, DisplayLatencies, Request, TimedStep, nice};
use crate::dataset::{self, ActionOrigin, AuditEntry, OperatorAction, Wrist, replay_watched};
use crate::fit::PreprocessingSettings;
use crate::protocol::ValidProtocol;
use crate::session::{Progress, Settings};

/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(5);
/// How often a recording that stands still looks whether it is to go on.
const IDLE: Duration = Duration::from_millis(10);
/// How often it is drawn while it stands still.
const STILL: Duration = Duration::from_millis(500);
/// Slowest and fastest that a recording is played.
const SPEEDS: [f64; 2] = [0.05, 1000.0];

/// A recorded session, as far as it must be known before it is played.
struct RecordedSession {
    folder: PathBuf,
    settings: Arc<Settings>,
    about: SessionInfo,
    wrist: Wrist,
    /// Time before each start of the session, s.
    before_s: Vec<f64>,
    length_s: f64,
    /// What was done at consoles: start, from 0, and deed.
    remarks: Vec<(usize, AuditEntry)>,
}

impl RecordedSession {
    /// Goes through the whole session once.
    fn read(folder: &Path, wrist: Option<Wrist>) -> Result<(Self, ViewModel, super::Views), ConsoleError> {
        let session = dataset::load(folder)?;
        let protocol = ValidProtocol::read(&folder.join("protocol.json"))?;
        let remarks: Vec<_> =
            dataset::remarks(folder)?.into_iter().map(|(start, remark)| (start - 1, remark)).collect();
        let (mut settings, mut steps, mut starts) = (None, 0u64, Vec::new());
        replay_watched(folder, &mut |_, _, machine| {
            if machine.sample() == 1 {
                starts.push(steps);
            }
            steps += 1;
            settings.get_or_insert_with(|| machine.settings().clone());
            ControlFlow::Continue(())
        })?;
        let mut settings = settings.ok_or_else(|| ConsoleError::Empty(folder.to_owned()))?;
        // A replay is told of limits by the journal; pages show those of the protocol.
        settings.limits = protocol.limits.clone();
        let rate_hz = settings.sample_rate_hz;
        let opened = remarks.iter().find_map(|(_, remark)| match remark.deed {
            OperatorAction::Opened { wrist } => Some(wrist),
            _ => None,
        });
        let recording = Self {
            folder: folder.to_owned(),
            about: SessionInfo {
                protocol: protocol.name.clone(),
                subject: session.subject.id.clone(),
                folder: folder.display().to_string(),
                rig: "recording".to_owned(),
            },
            wrist: wrist.or(opened).unwrap_or_default(),
            before_s: starts.iter().map(|steps| *steps as f64 / rate_hz).collect(),
            length_s: steps as f64 / rate_hz,
            settings: Arc::new(settings),
            remarks,
        };
        let fitter = Fitter::start(TrialFitContext {
            subject: session.subject.id,
            sample_rate_hz: session.sample_rate_hz,
            lever: session.lever,
            view: PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter },
        });
        let progress = Progress::new(&recording.settings);
        let tape = PlaybackState { speed: 1.0, is_playing: false, length_s: recording.length_s };
        let (hub, views) = ViewModel::new(recording.settings.clone(), progress, fitter, Some(tape));
        hub.fit(session.trials);
        Ok((recording, hub, views))
    }
}

/// What was asked of the player.
#[derive(Debug, Clone, Copy, PartialEq)]
struct PlaybackRequest {
    speed: f64,
    plays: bool,
    /// Where to, s.
    seek: Option<f64>,
    over: bool,
}

/// What the operator's page does to a recording.
#[derive(Debug, Clone)]
struct PlaybackControls(Arc<Mutex<PlaybackRequest>>);

impl PlaybackControls {
    fn wish(&self) -> PlaybackRequest {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn change(&self, change: impl FnOnce(&mut PlaybackRequest)) {
        change(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner));
    }
}

impl Controls for PlaybackControls {
    fn hear(&self, request: Request, _desk: ActionOrigin) {
        match request {
            Request::Play { speed, plays } if speed.is_finite() => {
                let [slowest, fastest] = SPEEDS;
                self.change(|wish| (wish.speed, wish.plays) = (speed.clamp(slowest, fastest), plays));
            }
            Request::Seek { t_s } if t_s.is_finite() => self.change(|wish| wish.seek = Some(t_s.max(0.0))),
            // There is nobody any more who could hear the others.
            _ => {}
        }
    }
}

/// A recording that is being watched, until this is dropped.
pub struct Playback {
    remote: PlaybackControls,
    player: Option<JoinHandle<()>>,
    server: Server,
}

impl Playback {
    /// Opens the pages of the session in `folder`; `wrist` overrides what was recorded.
    ///
    /// # Errors
    /// If the session cannot be read or the pages cannot be served.
    pub fn open(folder: &Path, address: &Address, wrist: Option<Wrist>) -> Result<Self, ConsoleError> {
        let (recording, hub, views) = RecordedSession::read(folder, wrist)?;
        let tape = views.now().borrow().tape;
        let wish = PlaybackRequest { speed: 1.0, plays: false, seek: None, over: false };
        let remote = PlaybackControls(Arc::new(Mutex::new(wish)));
        let content = Content {
            hello: hello(&recording.about, &recording.settings, recording.wrist, tape),
            views,
            controls: Arc::new(remote.clone()),
            screen: DisplayLatencies::default(),
        };
        let server = Server::start(address, content)?;
        let player = Player {
            recording,
            hub,
            remote: remote.clone(),
            start: 0,
            told: 0,
            anchor: None,
            drawn: Instant::now(),
            go_to_s: 0.0,
            is_broken_off: false,
        };
        let player = thread::Builder::new()
            .name("player".to_owned())
            .spawn(move || player.play())
            .map_err(ConsoleError::Start)?;
        Ok(Self { remote, player: Some(player), server })
    }

    /// Where its pages are.
    pub fn pages(&self) -> PageAddresses {
        PageAddresses { operator: self.server.url(Role::Operator), person: self.server.url(Role::Person) }
    }
}

impl Drop for Playback {
    fn drop(&mut self) {
        self.remote.change(|wish| wish.over = true);
        if let Some(player) = self.player.take() {
            // It has nothing to say that could still be of use.
            let _ = player.join();
        }
    }
}

/// Plays a recording.
struct Player {
    recording: RecordedSession,
    hub: ViewModel,
    remote: PlaybackControls,
    /// Which start of the session is being played, from 1; 0 before the first.
    start: usize,
    /// How many remarks were told.
    told: usize,
    /// Where it was last in step with the clock: then, there in s, and at what speed.
    anchor: Option<(Instant, f64, f64)>,
    drawn: Instant,
    /// Up to where it goes without drawing, s.
    go_to_s: f64,
    /// It is to begin anew, or to end.
    is_broken_off: bool,
}

impl Player {
    /// Until it is over.
    fn play(mut self) {
        nice();
        while !self.remote.wish().over {
            let folder = self.recording.folder.clone();
            (self.start, self.told, self.anchor, self.is_broken_off) = (0, 0, None, false);
            self.hub.rewind(Progress::new(&self.recording.settings));
            let played = replay_watched(&folder, &mut |input, output, machine| {
                if machine.sample() == 1 {
                    let before_s = self.recording.before_s.get(self.start).copied().unwrap_or(0.0);
                    self.start += 1;
                    // The first step begins a session, and changes nothing of what is done.
                    self.hub.restart(machine.progress().clone(), before_s);
                }
                self.hub.take(&TimedStep::new(input, output, machine));
                self.keep_pace(machine.sample())
            });
            match played {
                Ok(replay) => {
                    if let Some(difference) = &replay.difference {
                        self.hub.alarm(&format!("from here on a replay goes another way: {difference}"));
                    }
                }
                Err(error) => self.hub.alarm(&error.to_string()),
            }
            if !self.is_broken_off {
                self.stand_at_end();
            }
        }
    }

    /// After each step: tells what was done then, and waits for the next one's time.
    fn keep_pace(&mut self, sample: u64) -> ControlFlow<()> {
        self.tell_remarks(sample);
        let rate_hz = self.recording.settings.sample_rate_hz;
        let before_s = self.recording.before_s.get(self.start - 1).copied().unwrap_or(0.0);
        let t_s = before_s + sample as f64 / rate_hz;
        if t_s < self.go_to_s {
            return ControlFlow::Continue(());
        }
        loop {
            let wish = self.remote.wish();
            if wish.over || wish.seek.is_some() {
                self.begin_anew(wish);
                return ControlFlow::Break(());
            }
            if !wish.plays {
                self.anchor = None;
                self.draw(wish, STILL);
                thread::sleep(IDLE);
                continue;
            }
            let (then, there_s, speed) = *self.anchor.get_or_insert((Instant::now(), t_s, wish.speed));
            if speed != wish.speed {
                self.anchor = None;
                continue;
            }
            let due = Duration::from_secs_f64((t_s - there_s).max(0.0) / speed);
            let ahead = due.saturating_sub(then.elapsed());
            self.draw(wish, PICTURE);
            if ahead < PICTURE / 2 {
                return ControlFlow::Continue(());
            }
            thread::sleep(ahead.min(IDLE));
        }
    }

    fn tell_remarks(&mut self, sample: u64) {
        while let Some((start, remark)) = self.recording.remarks.get(self.told) {
            let is_due = (*start + 1, remark.sample) <= (self.start, sample);
            if !is_due {
                return;
            }
            self.hub.remark(remark);
            self.told += 1;
        }
    }

    /// Draws, unless it did so a moment ago.
    fn draw(&mut self, wish: PlaybackRequest, pause: Duration) {
        let tape =
            PlaybackState { speed: wish.speed, is_playing: wish.plays, length_s: self.recording.length_s };
        let is_changed = self.hub.set_tape(tape);
        if is_changed || self.drawn.elapsed() >= pause {
            self.hub.publish();
            self.drawn = Instant::now();
        }
    }

    fn begin_anew(&mut self, wish: PlaybackRequest) {
        self.is_broken_off = true;
        // Before the very end there is always something to see.
        self.go_to_s = wish.seek.unwrap_or(0.0).min(self.recording.length_s - 0.001);
        self.remote.change(|now| now.seek = now.seek.filter(|seek| Some(*seek) != wish.seek));
    }

    /// The recording has come to its end.
    fn stand_at_end(&mut self) {
        self.remote.change(|wish| wish.plays = false);
        loop {
            let wish = self.remote.wish();
            self.draw(wish, STILL);
            if wish.over || wish.seek.is_some() || wish.plays {
                return self.begin_anew(wish);
            }
            thread::sleep(IDLE);
        }
    }
}
