//! The console of a running session: its threads and the channels between them.

use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, PoisonError, mpsc};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use rtrb::Consumer;

use super::coming_and_going::ComingAndGoing;
use super::command_questions::CommandQuestions;
use super::commands::{CommandReceiver, CommandSender, OperatorNotice, needs_confirmation};
use super::controls::{Controls, Request};
use super::display_latency::DisplayLatencies;
use super::error::ConsoleError;
use super::fitter::{Fitter, TrialFitContext};
use super::history::SystemStatus;
use super::presence::Presence;
use super::step_feed::{SampleCounter, StepFeed, TimedStep};
use super::terminal::Terminal;
use super::thread_priority::lower_thread_priority;
use super::view_model::ViewModel;
use super::web::{Address, PageAddresses, PageContent, PageDisplay, Server, SessionContent};
use super::welcome::{SessionInfo, welcome_messages};
use crate::dataset::{ActionOrigin, AuditSender, LONGEST_NOTE, OperatorAction, Trial, Wrist};
use crate::session::{Machine, Source};

/// Time between two checks for new steps.
const STEP_POLL: Duration = Duration::from_millis(2);
/// Shortest time between two snapshots.
const SNAPSHOT_PERIOD: Duration = Duration::from_millis(4);
/// Longest time between two snapshots, without new steps.
const IDLE_SNAPSHOT_PERIOD: Duration = Duration::from_millis(500);
/// Time between two readings of the disk space and the loop's timing.
const STATUS_PERIOD: Duration = Duration::from_millis(500);
/// Longest time that the closing message waits for the fits of the last trials.
const FIT_WAIT: Duration = Duration::from_secs(10);
/// Longest time of day that is kept with a note, in bytes.
const LONGEST_CLOCK: usize = 40;

/// What a session's console consists of, and what it must know of the session.
#[derive(Debug, Clone)]
pub struct ConsoleSetup {
    /// The web pages; `None` serves none.
    pub pages: Option<Pages>,
    /// Whether the terminal shows the session.
    pub terminal: bool,
    /// Wrist in the handle.
    pub wrist: Wrist,
    /// Time without an operator's page after which the session pauses after the trial; `None` never pauses it.
    pub missed_after: Option<Duration>,
    /// Whether the session starts without an operator's command (`--yes`).
    pub starts_at_once: bool,
    /// Whether the control loop has no deadlines and may wait for the disk and the console.
    pub may_wait: bool,
    /// What the operator is asked before commands of this rig.
    pub questions: CommandQuestions,
    /// Description of the session for the pages.
    pub info: SessionInfo,
    /// What the fit of a trial needs beside the trial.
    pub fit_context: TrialFitContext,
    /// Trials measured before the session was resumed.
    pub earlier_trials: Vec<Trial>,
    /// The session's folder.
    pub folder: PathBuf,
}

/// Where the web pages of a session are.
#[derive(Debug, Clone)]
pub enum Pages {
    /// The session has pages of its own, at this address.
    Own(Address),
    /// Pages that are there before and after the session.
    Of(PageDisplay),
}

/// The console of a running session.
pub struct Live {
    worker: Option<JoinHandle<()>>,
    closing_message: Arc<Mutex<Option<String>>>,
    commands: CommandSender,
    server: Option<Server>,
    /// Opens the terminal, until it is taken.
    open_terminal: Option<Box<dyn FnOnce() -> Result<Terminal, ConsoleError>>>,
    terminal: Option<Terminal>,
}

impl Live {
    /// Opens the console of a session that is about to run. Returns the console, the consumer of the control loop's steps
    /// and the source of the operator's commands. When `stop` is set, the session ends at once.
    ///
    /// # Errors
    /// If the pages cannot be served or the threads cannot be started.
    pub fn open(
        setup: ConsoleSetup,
        machine: &Machine,
        journal: AuditSender,
        stop: Arc<AtomicBool>,
    ) -> Result<(Self, StepFeed, CommandReceiver), ConsoleError> {
        let settings = Arc::new(machine.settings().clone());
        let counter = SampleCounter::default();
        let (commands, receiver, notices) =
            CommandSender::new(journal, counter.clone(), stop.clone(), setup.starts_at_once);
        let (feed, steps) = StepFeed::new(counter, setup.may_wait);
        let fitter = Fitter::start(setup.fit_context);
        let (mut view, views) =
            ViewModel::new(settings.clone(), machine.progress().clone(), fitter, setup.questions, None);
        view.fit(setup.earlier_trials);
        let presence = Presence::new(setup.missed_after);
        let controls = Arc::new(SessionControls {
            commands: commands.clone(),
            presence: presence.clone(),
            pages: Mutex::new(ComingAndGoing::new(Instant::now())),
        });
        let latencies = DisplayLatencies::default();
        let content = PageContent::Session(SessionContent {
            welcome: welcome_messages(&setup.info, &settings, setup.wrist, None),
            views: views.clone(),
            controls: controls.clone(),
            latencies: latencies.clone(),
        });
        let server = match &setup.pages {
            Some(Pages::Own(address)) => Some(Server::start(address, content)?),
            Some(Pages::Of(display)) => {
                display.show(content);
                None
            }
            None => None,
        };
        commands.record(OperatorAction::Opened { wrist: setup.wrist }, ActionOrigin::Program);
        let info = setup.info;
        let open_terminal = move || Terminal::open(views, controls, info, stop);
        let open_terminal = setup.terminal.then(|| Box::new(open_terminal) as Box<_>);
        let closing_message = Arc::new(Mutex::new(None));
        let worker = Worker {
            view,
            steps,
            notices,
            commands: commands.clone(),
            presence,
            latencies,
            folder: setup.folder,
            closing_message: closing_message.clone(),
        };
        let worker = thread::Builder::new()
            .name("view model".to_owned())
            .spawn(move || worker.run())
            .map_err(ConsoleError::Start)?;
        let live =
            Self { worker: Some(worker), closing_message, commands, server, open_terminal, terminal: None };
        Ok((live, feed, receiver))
    }

    /// Addresses of the session's own pages, if it has any.
    pub fn pages(&self) -> Option<PageAddresses> {
        self.server.as_ref().map(Server::pages)
    }

    /// Shows the operator notices, from any thread.
    pub fn notices(&self) -> impl Fn(OperatorNotice) + Send + Sync + use<> {
        let commands = self.commands.clone();
        move |notice| commands.notify(notice)
    }

    /// Draws the session in the terminal, if the setup says so. Print messages before this call.
    ///
    /// # Errors
    /// If the terminal cannot be drawn on.
    pub fn take_terminal(&mut self) -> Result<(), ConsoleError> {
        if let Some(open) = self.open_terminal.take() {
            self.terminal = Some(open()?);
        }
        Ok(())
    }

    /// Gives the terminal back, so that messages can be printed there.
    pub fn release_terminal(&mut self) {
        self.terminal = None;
    }

    /// Shows `message` on all pages and closes the console.
    pub fn close(mut self, message: &str) {
        *self.closing_message.lock().unwrap_or_else(PoisonError::into_inner) = Some(message.to_owned());
        if let Some(worker) = self.worker.take() {
            // If the thread panicked, there is nothing left to show.
            let _ = worker.join();
        }
        drop(self.server.take());
    }
}

impl Drop for Live {
    /// Closes the console of a session that failed.
    fn drop(&mut self) {
        let mut message = self.closing_message.lock().unwrap_or_else(PoisonError::into_inner);
        message.get_or_insert_with(|| "the program has ended".to_owned());
    }
}

/// The thread that updates the view model.
struct Worker {
    view: ViewModel,
    steps: Consumer<TimedStep>,
    notices: mpsc::Receiver<OperatorNotice>,
    commands: CommandSender,
    presence: Presence,
    latencies: DisplayLatencies,
    folder: PathBuf,
    closing_message: Arc<Mutex<Option<String>>>,
}

impl Worker {
    fn run(mut self) {
        lower_thread_priority();
        let (mut published, mut status_read) = (Instant::now(), None::<Instant>);
        let mut closing_since = None::<Instant>;
        loop {
            // Read before the ring is emptied, so that the last steps are still shown.
            let closing = self.closing_message.lock().unwrap_or_else(PoisonError::into_inner).clone();
            let mut changed = false;
            while let Ok(step) = self.steps.pop() {
                self.view.take(&step);
                changed = true;
                if published.elapsed() >= SNAPSHOT_PERIOD {
                    break;
                }
            }
            for notice in self.notices.try_iter() {
                match notice {
                    OperatorNotice::Action(entry) => self.view.add_action(&entry),
                    OperatorNotice::Alarm(text) => self.view.add_alarm(&text),
                    OperatorNotice::Message(text) => self.view.add_message(&text),
                }
                changed = true;
            }
            if let Some(timeout) = self.presence.is_missed() {
                let action = OperatorAction::Missed { after_s: timeout.as_secs_f64() };
                self.commands.pause_after_trial(action, ActionOrigin::Program);
            }
            if status_read.is_none_or(|at| at.elapsed() >= STATUS_PERIOD) {
                self.view.set_status(SystemStatus {
                    vitals: self.commands.vitals(),
                    disk_free_bytes: free_bytes(&self.folder),
                    display_latency: self.latencies.summary(),
                });
                status_read = Some(Instant::now());
            }
            if let Some(message) = closing.filter(|_| self.steps.is_empty()) {
                let waited = closing_since.get_or_insert_with(Instant::now).elapsed();
                if waited >= FIT_WAIT || !self.view.awaits_fits() {
                    self.view.close(&message);
                    return self.view.publish();
                }
            }
            let since = published.elapsed();
            if since >= IDLE_SNAPSHOT_PERIOD || changed && since >= SNAPSHOT_PERIOD {
                self.view.publish();
                published = Instant::now();
            }
            if self.steps.is_empty() {
                thread::sleep(STEP_POLL);
            }
        }
    }
}

/// Free space on the disk of a folder, bytes; `None` where the system does not report it.
#[cfg(unix)]
fn free_bytes(folder: &Path) -> Option<u64> {
    let disk = rustix::fs::statvfs(folder).ok()?;
    Some(disk.f_bavail.saturating_mul(disk.f_frsize))
}

#[cfg(not(unix))]
fn free_bytes(_folder: &Path) -> Option<u64> {
    None
}

/// What operators' requests do to a running session.
struct SessionControls {
    commands: CommandSender,
    presence: Presence,
    pages: Mutex<ComingAndGoing>,
}

impl Controls for SessionControls {
    fn request(&self, request: Request, origin: ActionOrigin) {
        match request {
            Request::Command { command, confirmed }
                if command.source() == Source::Operator && (confirmed || !needs_confirmation(command)) =>
            {
                self.commands.send(command, origin)
            }
            Request::PauseAfterTrial => {
                self.commands.pause_after_trial(OperatorAction::RequestedPauseAfterTrial, origin)
            }
            Request::Note { text, clock } => {
                let text = truncated(text.trim(), LONGEST_NOTE);
                let clock = clock.map(|clock| truncated(&clock, LONGEST_CLOCK));
                if !text.is_empty() {
                    self.commands.record(OperatorAction::Noted { text, clock }, origin);
                }
            }
            Request::Begin { .. } | Request::Resume { .. } => self
                .commands
                .alarm("a page asked to begin another session: this one runs, and the other was not begun"),
            // Not an operator's command, not confirmed, or meant for a recording or a laboratory.
            Request::Command { .. }
            | Request::Play { .. }
            | Request::Seek { .. }
            | Request::Choose { .. } => {}
        }
    }

    fn joined(&self, origin: ActionOrigin) {
        self.presence.opened();
        let mut pages = self.pages.lock().unwrap_or_else(PoisonError::into_inner);
        if pages.keeps_opening(Instant::now()) {
            self.commands.record(OperatorAction::Joined, origin);
        } else if pages.is_full_for_the_first_time() {
            self.commands
                .alarm("an operator's page is opened again and again: the journal keeps no more of that");
        }
    }

    fn left(&self, origin: ActionOrigin) {
        self.presence.closed();
        if self.pages.lock().unwrap_or_else(PoisonError::into_inner).keeps_closing() {
            self.commands.record(OperatorAction::Left, origin);
        }
    }
}

/// The first `most` bytes of a text, with blanks instead of control characters.
fn truncated(text: &str, most: usize) -> String {
    let end = text.floor_char_boundary(most);
    text[..end].chars().map(|c| if c.is_control() { ' ' } else { c }).collect()
}
