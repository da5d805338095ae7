//! The console of a laboratory: its pages choose a session, run it, and choose the next one, until the program is ended.
//!
//! One thread reads the folder, checks and takes the pages' requests, one after the other: of two pages that begin a session at once, the
//! second is late, because what was chosen has another number by then.

use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::sync::mpsc::Receiver;
use std::thread;
use std::time::Duration;

use crate::console::web::{LaboratoryContent, PageContent, Server};
use crate::console::{
    Choice, ConsoleError, LaboratoryControls, LaboratoryPublisher, LaboratoryRequest, LaboratoryView,
    ListedCheck, Notice, Outcome, Part,
};
use crate::dataset::{SessionCard, Wrist};
use crate::files;
use crate::protocol::ValidProtocol;

use super::laboratory_checks::{Chosen, checks};
use super::laboratory_lists::LaboratoryLists;
use super::laboratory_sessions::LaboratorySessions;
use super::{
    Console, ConsoleOptions, Failure, NewSessionFolder, Pace, PageOptions, RequestedSubject, ResumeRequest,
    SessionRequest, draw_seed, stop_on_signals, stored_streams,
};

/// Time between two looks at the folder, and at whether the program is to end.
const FOLDER_LOOK_PERIOD: Duration = Duration::from_millis(500);
/// Stack of the thread of a session, bytes: that of a program's first thread.
const SESSION_STACK_BYTES: usize = 8 << 20;

/// The lists of a laboratory, in the order in which they are shown.
const LISTS_SHOWN: [Part; 4] = [Part::Subject, Part::Protocol, Part::Rig, Part::Calibration];

/// What is the same for all sessions of the console.
#[derive(Debug)]
pub struct LaboratoryConsole {
    /// The laboratory's folder.
    pub folder: PathBuf,
    /// Options of the pages.
    pub pages: PageOptions,
    /// Time without an operator's page after which a session pauses, s.
    pub operator_timeout_s: f64,
    /// Speed on the virtual wrist.
    pub pace: Pace,
    /// Who runs the sessions.
    pub operator: Option<String>,
    /// Whether sessions are published over Lab Streaming Layer.
    pub lsl: bool,
    /// The file of liblsl; without one, it is where the operating system finds it.
    pub lsl_library: Option<PathBuf>,
}

/// What is chosen, and what is known of it.
struct Desk {
    lists: LaboratoryLists,
    chosen: Chosen,
    checks: Vec<ListedCheck>,
    /// Number of what is chosen and checked.
    number: u64,
    notice: Option<Notice>,
}

impl LaboratoryConsole {
    /// Serves the pages until the program is ended.
    ///
    /// # Errors
    /// If the folder is no laboratory, or the pages cannot be served.
    pub fn serve(&self, console: &Console) -> Result<(), Failure> {
        let mut desk = Desk::new(LaboratoryLists::read(&self.folder)?);
        let stop = stop_on_signals()?;
        let (publisher, views) = LaboratoryPublisher::new();
        let (controls, requests) = LaboratoryControls::new();
        let controls = Arc::new(controls);
        let content = || {
            PageContent::Laboratory(LaboratoryContent { views: views.clone(), controls: controls.clone() })
        };
        let mut sessions = LaboratorySessions::read(self.sessions());
        self.publish(&publisher, &desk, &sessions, false);
        let server = Server::start(&self.pages.address()?, content())?;
        self.options(None, &server).check()?;
        self.pages.announce(&server.pages(), console);
        while !stop.load(Ordering::Relaxed) {
            let request = requests.recv_timeout(FOLDER_LOOK_PERIOD).ok();
            desk.look(LaboratoryLists::read(&self.folder));
            let asked = match request {
                Some(LaboratoryRequest::Choose { part, name }) => {
                    desk.choose(part, name);
                    None
                }
                Some(LaboratoryRequest::Begin { number }) => {
                    desk.may_begin(number).then_some(RequestedRun::New)
                }
                Some(LaboratoryRequest::Resume { session }) => desk.unfinished(&sessions, &session),
                None => None,
            };
            let Some(asked) = asked else {
                self.publish(&publisher, &desk, &sessions, false);
                continue;
            };
            self.publish(&publisher, &desk, &sessions, true);
            // Nothing else is to use the disk while a session runs.
            drop(sessions);
            let ended = match asked {
                RequestedRun::New => self.run_session(&desk, &server, console),
                RequestedRun::Resumed { folder, subject } => {
                    self.resume_session(&folder, &subject, &server, console)
                }
            };
            sessions = LaboratorySessions::read(self.sessions());
            desk.end_session(ended);
            refuse_late(&requests, console);
            self.publish(&publisher, &desk, &sessions, false);
            server.display().show(content());
        }
        Ok(())
    }

    /// Options of the console of a session of this hand.
    fn options(&self, hand: Option<Wrist>, server: &Server) -> ConsoleOptions {
        let pages = self.pages.clone().with_wrist(hand);
        ConsoleOptions::on_display(pages, self.operator_timeout_s, server.display())
    }

    fn sessions(&self) -> PathBuf {
        self.folder.join("sessions")
    }

    fn publish(
        &self,
        publisher: &LaboratoryPublisher,
        desk: &Desk,
        sessions: &LaboratorySessions,
        is_beginning: bool,
    ) {
        let choice = |part| Choice {
            part,
            entries: desk.lists.entries(part),
            chosen: desk.chosen.get(&part).cloned(),
            is_optional: part == Part::Calibration,
        };
        publisher.publish(&LaboratoryView {
            folder: self.folder.display().to_string(),
            choices: LISTS_SHOWN.map(choice).to_vec(),
            checks: desk.checks.clone(),
            number: desk.number,
            may_begin: desk.all_passed() && !is_beginning,
            is_beginning,
            notice: desk.notice.clone(),
            sessions: sessions.found(),
        });
    }

    /// Runs a session with what is chosen, as `ramphold run` does; says how it ended.
    fn run_session(&self, desk: &Desk, server: &Server, console: &Console) -> Notice {
        let Some((subject, [protocol, rig])) = desk.parts() else {
            return Notice { text: "not everything is chosen".to_owned(), is_alarm: true };
        };
        let calibration = desk.file(Part::Calibration);
        let seed = draw_seed();
        let stem = protocol.file_stem().unwrap_or_default().to_string_lossy();
        let folder = NewSessionFolder::In(self.sessions(), &stem).of(&subject.id, seed);
        let options = self.options(subject.hand, server);
        let run = || -> Result<(), Failure> {
            SessionRequest {
                protocol: &ValidProtocol::read(&protocol)?,
                rig: Some(&rig),
                subject: Some(RequestedSubject::Identifier(&subject.id)),
                seed: Some(seed),
                folder: NewSessionFolder::Here(folder.clone()),
                pace: self.pace,
                model: None,
                hide: None,
                calibration: calibration.as_deref(),
                // Only the page arms a motor, and it asks.
                is_confirmed: false,
                operator: self.operator.as_deref(),
                hand: subject.hand,
                subject_fields: serde_json::Map::new(),
                lsl: self.lsl,
                lsl_library: self.lsl_library.as_deref(),
                console: &options,
            }
            .run(console)
        };
        let ended = on_own_thread(run);
        how_it_ended(ended, &subject.id, &folder, console)
    }

    /// Goes on with an unfinished session, as `ramphold resume` does; says how it ended.
    fn resume_session(&self, folder: &Path, subject: &str, server: &Server, console: &Console) -> Notice {
        let run = || -> Result<(), Failure> {
            let hand = SessionCard::read(folder)?.about.hand;
            // The library is refused where nothing needs it, and other sessions of the console may need it.
            let library = self.lsl_library.as_deref();
            let library = if stored_streams(folder)?.is_empty() { None } else { library };
            ResumeRequest {
                session: folder,
                // Only the page arms a motor, and it asks.
                is_confirmed: false,
                home_here: false,
                hide: None,
                pace: self.pace,
                lsl_library: library,
                console: &self.options(hand, server),
            }
            .run(console)
        };
        how_it_ended(on_own_thread(run), subject, folder, console)
    }
}

/// What a page asked for.
enum RequestedRun {
    /// A session with what is chosen.
    New,
    /// An unfinished session of the list.
    Resumed {
        /// Its folder.
        folder: PathBuf,
        /// Its subject.
        subject: String,
    },
}

/// Runs a session on a thread of its own: whatever it asked of the system for its thread ends with it.
fn on_own_thread(run: impl FnOnce() -> Result<(), Failure> + Send) -> Result<(), Failure> {
    thread::scope(|scope| {
        let thread = thread::Builder::new().name("session".to_owned()).stack_size(SESSION_STACK_BYTES);
        match thread.spawn_scoped(scope, run) {
            Ok(session) => session.join().unwrap_or_else(|panic| resume_unwind(panic)),
            Err(error) => Err(ConsoleError::Start(error).into()),
        }
    })
}

fn how_it_ended(ended: Result<(), Failure>, subject: &str, folder: &Path, console: &Console) -> Notice {
    match ended {
        Ok(()) => Notice {
            text: format!(
                "The session of {subject} is over. Its results are in {}",
                folder.join("results").display()
            ),
            is_alarm: false,
        },
        Err(failure) => {
            console.error(&failure);
            let what = match files::exists(folder) {
                true => format!("The session of {subject} in {}", folder.display()),
                false => format!("No session of {subject} has begun"),
            };
            Notice { text: format!("{what}: {failure}"), is_alarm: true }
        }
    }
}

/// Takes what pages asked while the session was being made or ran; nothing of it is done.
fn refuse_late(requests: &Receiver<LaboratoryRequest>, console: &Console) {
    for request in requests.try_iter() {
        if matches!(request, LaboratoryRequest::Begin { .. } | LaboratoryRequest::Resume { .. }) {
            console.message("a second page asked to begin a session at the same time; only one was begun");
        }
    }
}

impl Desk {
    fn new(lists: LaboratoryLists) -> Self {
        let mut desk = Self { lists, chosen: Chosen::new(), checks: Vec::new(), number: 0, notice: None };
        desk.choose_what_is_alone();
        desk.check();
        desk
    }

    /// Where a list has one line only, it is chosen.
    fn choose_what_is_alone(&mut self) {
        for part in [Part::Subject, Part::Protocol, Part::Rig] {
            if let [alone] = &self.lists.entries(part)[..] {
                self.chosen.entry(part).or_insert_with(|| alone.name.clone());
            }
        }
    }

    fn check(&mut self) {
        self.number += 1;
        self.checks = checks(&self.lists, &self.chosen);
    }

    /// Takes what the folder offers now; what has changed is checked again.
    fn look(&mut self, lists: Result<LaboratoryLists, Failure>) {
        match lists {
            Ok(lists) if lists == self.lists => {}
            Ok(lists) => {
                self.lists = lists;
                self.choose_what_is_alone();
                self.check();
            }
            Err(failure) => {
                let text = failure.to_string();
                if self.notice.as_ref().is_none_or(|notice| notice.text != text) {
                    self.lists.subjects = Err(text.clone());
                    self.notice = Some(Notice { text, is_alarm: true });
                    self.check();
                }
            }
        }
    }

    /// Chooses a line of a list, which must be in it.
    fn choose(&mut self, part: Part, name: Option<String>) {
        if self.notice.as_ref().is_some_and(|notice| notice.is_alarm) {
            self.notice = None;
        }
        let is_listed = |name: &String| self.lists.entries(part).iter().any(|entry| entry.name == *name);
        if name.as_ref().is_some_and(|name| !is_listed(name)) {
            let text = "What a page chose is not in the list; choose again".to_owned();
            self.notice = Some(Notice { text, is_alarm: true });
            return;
        }
        if self.chosen.get(&part) == name.as_ref() {
            return;
        }
        match name {
            Some(name) => self.chosen.insert(part, name),
            None => self.chosen.remove(&part),
        };
        self.check();
    }

    fn all_passed(&self) -> bool {
        self.checks.iter().all(|check| check.outcome == Outcome::Passed)
    }

    /// Whether a session may begin with what the view with this number showed; otherwise the notice says why not.
    fn may_begin(&mut self, number: u64) -> bool {
        let why = if number != self.number {
            "No session has begun: what was chosen, or a file of it, has changed since. Look at the checks, and begin again"
        } else if !self.all_passed() {
            "No session has begun: not all checks have passed"
        } else {
            return true;
        };
        self.notice = Some(Notice { text: why.to_owned(), is_alarm: true });
        false
    }

    /// The unfinished session of that name; otherwise the notice says why none goes on.
    fn unfinished(&mut self, sessions: &LaboratorySessions, name: &str) -> Option<RequestedRun> {
        let Some((folder, subject)) = sessions.unfinished(name) else {
            let text = "No session goes on: the list has no unfinished session of that name".to_owned();
            self.notice = Some(Notice { text, is_alarm: true });
            return None;
        };
        Some(RequestedRun::Resumed { folder, subject: subject.unwrap_or_default() })
    }

    /// After a session the next subject is chosen anew.
    fn end_session(&mut self, ended: Notice) {
        self.notice = Some(ended);
        self.chosen.remove(&Part::Subject);
        self.choose_what_is_alone();
        self.check();
    }

    /// Path of the file that is chosen of a list.
    fn file(&self, part: Part) -> Option<PathBuf> {
        Some(self.lists.file(part, self.chosen.get(&part)?)?.path.clone())
    }

    /// Subject, and the files of protocol and rig.
    fn parts(&self) -> Option<(super::laboratory_lists::ListedSubject, [PathBuf; 2])> {
        let subject = self.lists.subject(self.chosen.get(&Part::Subject)?)?.clone();
        Some((subject, [self.file(Part::Protocol)?, self.file(Part::Rig)?]))
    }
}
