//! What the operator's page shows of a laboratory in which no session runs, and the operator's choices on their way to the program.
//!
//! A page names only what the lists have, and the program looks it up there: nothing that a page sends is taken for a path.

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};

use serde::Serialize;
use serde_json::{Value, json};
use tokio::sync::watch;

use super::controls::{Controls, Part, Request};
use crate::dataset::ActionOrigin;

/// Requests that can wait for the program; more are left out.
const REQUEST_CAPACITY: usize = 64;

/// A line of a list to choose from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ListEntry {
    /// The name by which it is chosen.
    pub name: String,
    /// Text that stands beside the name; may be empty.
    pub about: String,
}

/// A list to choose from.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Choice {
    /// What is chosen.
    pub part: Part,
    /// The list.
    pub entries: Vec<ListEntry>,
    /// Name of the line that is chosen.
    pub chosen: Option<String>,
    /// Whether a session can do without.
    pub is_optional: bool,
}

/// Outcome of a check.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Outcome {
    /// It is as it must be.
    Passed,
    /// A session cannot begin before this is mended.
    Failed,
    /// It cannot be told before something else is chosen or mended.
    Open,
}

/// A check before a session.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ListedCheck {
    /// What is checked.
    pub name: &'static str,
    /// Its outcome.
    pub outcome: Outcome,
    /// What was found, or what to do.
    pub text: String,
}

/// A session of the laboratory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ListedSession {
    /// Name of its folder.
    pub session: String,
    /// When it began, in UTC.
    pub started_utc: Option<String>,
    /// The subject.
    pub subject: Option<String>,
    /// Trials of status ok, and all.
    pub trials: [usize; 2],
    /// How far it is.
    pub state: &'static str,
    /// What is wrong with it.
    pub reasons: Vec<String>,
}

/// How the last session ended, or why it did not begin.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Notice {
    /// What happened.
    pub text: String,
    /// Whether it needs attention.
    pub is_alarm: bool,
}

/// What the operator's page shows of a laboratory.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct LaboratoryView {
    /// The laboratory's folder.
    pub folder: String,
    /// The lists.
    pub choices: Vec<Choice>,
    /// The checks of what is chosen.
    pub checks: Vec<ListedCheck>,
    /// Number of what is chosen and checked; it changes whenever either does.
    pub number: u64,
    /// Whether all checks passed.
    pub may_begin: bool,
    /// Whether a session is being made.
    pub is_beginning: bool,
    /// What happened last.
    pub notice: Option<Notice>,
    /// The sessions that there are; `None` while they are being read.
    pub sessions: Option<Vec<ListedSession>>,
}

/// Read access to the latest view, as JSON.
#[derive(Debug, Clone)]
pub struct LaboratoryViews(watch::Receiver<Arc<Value>>);

impl LaboratoryViews {
    /// Receiver of the latest view.
    pub(super) fn receiver(&self) -> watch::Receiver<Arc<Value>> {
        self.0.clone()
    }
}

/// Publishes the view of a laboratory.
#[derive(Debug)]
pub struct LaboratoryPublisher(watch::Sender<Arc<Value>>);

impl LaboratoryPublisher {
    /// The publisher, and where pages read. Nothing is published yet.
    pub fn new() -> (Self, LaboratoryViews) {
        let (sender, receiver) = watch::channel(Arc::new(Value::Null));
        (Self(sender), LaboratoryViews(receiver))
    }

    /// Publishes a view, unless it is the last one.
    pub fn publish(&self, view: &LaboratoryView) {
        let view = json!(view);
        self.0.send_if_modified(|last| {
            let is_new = **last != view;
            if is_new {
                *last = Arc::new(view);
            }
            is_new
        });
    }
}

/// What an operator asks for in a laboratory.
#[derive(Debug, Clone, PartialEq)]
pub enum LaboratoryRequest {
    /// Choose a line of a list.
    Choose {
        /// The list.
        part: Part,
        /// Name of the line; `None` for none.
        name: Option<String>,
    },
    /// Begin a session with what is chosen, as the view with this number showed it.
    Begin {
        /// The number.
        number: u64,
    },
    /// Go on with an unfinished session.
    Resume {
        /// Its name in the list.
        session: String,
    },
}

/// Passes the requests of operators' pages on to the program.
#[derive(Debug)]
pub struct LaboratoryControls(SyncSender<LaboratoryRequest>);

impl LaboratoryControls {
    /// The controls, and where the program hears of the requests.
    pub fn new() -> (Self, Receiver<LaboratoryRequest>) {
        let (sender, receiver) = sync_channel(REQUEST_CAPACITY);
        (Self(sender), receiver)
    }
}

impl Controls for LaboratoryControls {
    fn request(&self, request: Request, _: ActionOrigin) {
        let request = match request {
            Request::Choose { part, name } => LaboratoryRequest::Choose { part, name },
            Request::Begin { number } => LaboratoryRequest::Begin { number },
            Request::Resume { session } => LaboratoryRequest::Resume { session },
            // The others are for a session.
            _ => return,
        };
        // While the program is busy, a page that asks for more than that is not heard.
        let _ = self.0.try_send(request);
    }
}
