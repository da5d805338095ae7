//! A session with its console: the threads, and who hears whom.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rtrb::Consumer;

use super::fitter::{Fitter, TrialFitContext};
use super::history::SystemStatus;
use super::terminal::Terminal;
use super::view_model::ViewModel;
use super::web::{Address, Content, Role, Server};
use super::welcome::{SessionInfo, hello};
use super::{
    CommandReceiver, CommandSender, ConsoleError, Controls, DisplayLatencies, OperatorNotice, Request,
    SampleCounter, Tapped, TimedStep, nice,
};
use crate::dataset::{ActionOrigin, BackgroundRecorder, LONGEST_NOTE, OperatorAction, Trial, Wrist};
use crate::session::{Event, Machine, Source};

/// How often the hub looks for steps.
const IDLE: Duration = Duration::from_millis(2);
/// Time between two pictures.
const PICTURE: Duration = Duration::from_millis(4);
/// Time between two pictures while nothing moves.
const STILL: Duration = Duration::from_millis(500);
/// Time between two looks at the disk and at how the loop fares.
const GAUGED: Duration = Duration::from_millis(500);

/// What console a session is to have.
#[derive(Debug, Clone)]
pub struct ConsoleSetup {
    /// PageAddresses in a browser.
    pub pages: Option<Address>,
    /// The terminal.
    pub terminal: bool,
    /// Which wrist is in the handle.
    pub wrist: Wrist,
    /// Pause after the trial when no operator was there for so long; `None` never does.
    pub missed_after: Option<Duration>,
    /// The operator's word was given beforehand: the session starts at once.
    pub starts_at_once: bool,
    /// The loop has no deadlines, and may be made to wait.
    pub is_patient: bool,
    /// What there is to know of the session.
    pub about: SessionInfo,
    /// What it takes to fit its trials.
    pub circumstances: TrialFitContext,
    /// Trials that were measured before the session was resumed.
    pub earlier: Vec<Trial>,
    /// The session's folder.
    pub folder: PathBuf,
}

/// Where the pages are. Whoever knows an address has its role.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct PageAddresses {
    /// The operator's.
    pub operator: String,
    /// The person's.
    pub person: String,
}

/// The console of a session that runs.
pub struct Live {
    hub: Option<JoinHandle<()>>,
    over: Arc<Mutex<Option<String>>>,
    server: Option<Server>,
    /// What the terminal needs, until it is taken.
    awaits_terminal: Option<Box<dyn FnOnce() -> Result<Terminal, ConsoleError>>>,
    terminal: Option<Terminal>,
}

impl Live {
    /// Opens the console of a session that is about to run: what the loop needs of it, and the console itself. `stop` is
    /// set where the session is to end at once.
    ///
    /// # Errors
    /// If the pages cannot be served or the terminal cannot be drawn on.
    pub fn open(
        plan: ConsoleSetup,
        machine: &Machine,
        recorder: BackgroundRecorder,
        stop: Arc<AtomicBool>,
    ) -> Result<(Self, Tapped<BackgroundRecorder>, CommandReceiver), ConsoleError> {
        let settings = Arc::new(machine.settings().clone());
        let place = SampleCounter::default();
        let (orders, listener, told) =
            CommandSender::new(recorder.remarks(), place.clone(), stop.clone(), plan.starts_at_once);
        let (tapped, beats) = Tapped::new(recorder, place, plan.is_patient);
        let fitter = Fitter::start(plan.circumstances);
        let (hub, views) = ViewModel::new(settings.clone(), machine.progress().clone(), fitter, None);
        hub.fit(plan.earlier);
        let presence = Presence::new(plan.missed_after);
        let controls = Arc::new(SessionControls { orders: orders.clone(), presence: presence.clone() });
        let screen = DisplayLatencies::default();
        let content = Content {
            hello: hello(&plan.about, &settings, plan.wrist, None),
            views: views.clone(),
            controls: controls.clone(),
            screen: screen.clone(),
        };
        let server = plan.pages.as_ref().map(|address| Server::start(address, content)).transpose()?;
        orders.note(OperatorAction::Opened { wrist: plan.wrist }, ActionOrigin::Program);
        let about = plan.about;
        let open_terminal = move || Terminal::open(views, controls, about, stop);
        let awaits_terminal = plan.terminal.then(|| Box::new(open_terminal) as Box<_>);
        let over = Arc::new(Mutex::new(None));
        let worker =
            Worker { hub, beats, told, orders, presence, screen, folder: plan.folder, over: over.clone() };
        let hub = thread::Builder::new()
            .name("hub".to_owned())
            .spawn(move || worker.work())
            .map_err(ConsoleError::Start)?;
        let live = Self { hub: Some(hub), over, server, awaits_terminal, terminal: None };
        Ok((live, tapped, listener))
    }

    /// Where its pages are.
    pub fn pages(&self) -> Option<PageAddresses> {
        let server = self.server.as_ref()?;
        Some(PageAddresses { operator: server.url(Role::Operator), person: server.url(Role::Person) })
    }

    /// Takes the terminal, if it is to. What is to be read there beforehand has been printed.
    ///
    /// # Errors
    /// If it cannot be drawn on.
    pub fn take_terminal(&mut self) -> Result<(), ConsoleError> {
        if let Some(open) = self.awaits_terminal.take() {
            self.terminal = Some(open()?);
        }
        Ok(())
    }

    /// Gives the terminal back, for what is to be printed there.
    pub fn give_terminal_back(&mut self) {
        drop(self.terminal.take());
    }

    /// Tells everybody how it ended, and closes.
    pub fn close(mut self, said: &str) {
        *self.over.lock().unwrap_or_else(PoisonError::into_inner) = Some(said.to_owned());
        if let Some(hub) = self.hub.take() {
            // It has nothing to say that could still be of use.
            let _ = hub.join();
        }
        drop(self.server.take());
    }
}

impl Drop for Live {
    /// A session that failed closes its console, too.
    fn drop(&mut self) {
        let mut over = self.over.lock().unwrap_or_else(PoisonError::into_inner);
        over.get_or_insert_with(|| "the program has ended".to_owned());
    }
}

/// The hub at work on a thread of its own.
struct Worker {
    hub: ViewModel,
    beats: Consumer<TimedStep>,
    told: mpsc::Receiver<OperatorNotice>,
    orders: CommandSender,
    presence: Presence,
    screen: DisplayLatencies,
    folder: PathBuf,
    over: Arc<Mutex<Option<String>>>,
}

impl Worker {
    fn work(mut self) {
        nice();
        let (mut drawn, mut gauged) = (Instant::now(), None::<Instant>);
        loop {
            // Instruction before looking, so that what came just before the end is still seen.
            let over = self.over.lock().unwrap_or_else(PoisonError::into_inner).clone();
            let mut is_news = false;
            while let Ok(beat) = self.beats.pop() {
                self.hub.take(&beat);
                is_news = true;
                if drawn.elapsed() >= PICTURE {
                    break;
                }
            }
            for told in self.told.try_iter() {
                match told {
                    OperatorNotice::Did(remark) => self.hub.remark(&remark),
                    OperatorNotice::Alarm(text) => self.hub.alarm(&text),
                }
                is_news = true;
            }
            if let Some(after) = self.presence.is_missed() {
                self.orders.pause_after_trial(
                    OperatorAction::Missed { after_s: after.as_secs_f64() },
                    ActionOrigin::Program,
                );
            }
            if gauged.is_none_or(|at| at.elapsed() >= GAUGED) {
                let disk_free_bytes = free_bytes(&self.folder);
                let screen = self.screen.in_short();
                self.hub.gauge(SystemStatus { vitals: self.orders.vitals(), disk_free_bytes, screen });
                gauged = Some(Instant::now());
            }
            if let Some(said) = over.filter(|_| self.beats.is_empty()) {
                self.hub.over(&said);
                return self.hub.publish();
            }
            let since = drawn.elapsed();
            if since >= STILL || is_news && since >= PICTURE {
                self.hub.publish();
                drawn = Instant::now();
            }
            if self.beats.is_empty() {
                thread::sleep(IDLE);
            }
        }
    }
}

/// Bytes left on the disk of a folder, where the system tells.
#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(not(unix))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}

/// Whether an operator is there.
#[derive(Debug, Clone)]
struct Presence {
    /// How many there are, and since when there was none.
    state: Arc<Mutex<(usize, Option<Instant>)>>,
    patience: Option<Duration>,
}

impl Presence {
    fn new(patience: Option<Duration>) -> Self {
        Self { state: Arc::default(), patience }
    }

    fn come(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        *state = (state.0 + 1, None);
    }

    fn go(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.0 = state.0.saturating_sub(1);
        state.1 = (state.0 == 0).then(Instant::now);
    }

    /// For how long there was none, said once when it is too long.
    fn is_missed(&self) -> Option<Duration> {
        let patience = self.patience?;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let missed = state.1.is_some_and(|since| since.elapsed() >= patience);
        if missed {
            state.1 = None;
        }
        missed.then_some(patience)
    }
}

/// What an operator's desks do.
struct SessionControls {
    orders: CommandSender,
    presence: Presence,
}

impl Controls for SessionControls {
    fn hear(&self, request: Request, desk: ActionOrigin) {
        match request {
            Request::Word { word, sure }
                if word.source() == Source::Operator && (sure || !is_final(word)) =>
            {
                self.orders.say(word, desk)
            }
            Request::PauseAfterTrial => {
                self.orders.pause_after_trial(OperatorAction::AskedForPauseAfterTrial, desk)
            }
            Request::Note { text, clock } => {
                let (text, clock) = (cut(text.trim(), LONGEST_NOTE), clock.map(|clock| cut(&clock, 40)));
                if !text.is_empty() {
                    self.orders.note(OperatorAction::Noted { text, clock }, desk);
                }
            }
            // Nothing that an operator says, not sure, or meant for a recording.
            Request::Word { .. } | Request::Play { .. } | Request::Seek { .. } => {}
        }
    }

    fn joined(&self, desk: ActionOrigin) {
        self.presence.come();
        self.orders.note(OperatorAction::Joined, desk);
    }

    fn left(&self, desk: ActionOrigin) {
        self.presence.go();
        self.orders.note(OperatorAction::Left, desk);
    }
}

/// What moves a motor or cannot be taken back needs a second word.
pub(super) fn is_final(word: Event) -> bool {
    matches!(word, Event::Start | Event::Rearm | Event::Abort | Event::Skip | Event::Repeat)
}

/// The beginning of a text, at most so many bytes, without what no line may hold.
fn cut(text: &str, most: usize) -> String {
    let end = text.floor_char_boundary(most);
    text[..end].chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
