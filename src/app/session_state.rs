//! How far a session is: unfinished, measured, fitted, diagnosed, or doubtful.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::consistency;
use crate::dataset::{self, JOURNAL, MANIFEST, SessionCard, Status, every_trial_is_done};
use crate::files::Folder;
use crate::report::{foreign_results, undescribed};

use super::console::Console;

/// How far a session is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum SessionState {
    /// It was not brought to its end; `ramphold resume` goes on with it.
    Unfinished,
    /// It was measured, and there is no fit yet.
    Measured,
    /// It has a fit.
    Fitted,
    /// It has a fit and a diagnosis.
    Diagnosed,
    /// Something in it does not go together.
    Doubtful,
}

impl SessionState {
    /// Name in lists.
    pub fn name(self) -> &'static str {
        match self {
            Self::Unfinished => "unfinished",
            Self::Measured => "measured",
            Self::Fitted => "fitted",
            Self::Diagnosed => "diagnosed",
            Self::Doubtful => "doubtful",
        }
    }
}

fn has(folder: &Path, name: &str) -> bool {
    Folder::open(folder).is_ok_and(|folder| folder.contains(name))
}

fn has_trials_left(folder: &Path) -> bool {
    every_trial_is_done(folder).is_ok_and(|done| !done)
}

/// Says that the session in `folder` is unfinished, if trials are left to do.
pub fn announce_unfinished(folder: &Path, console: &Console) {
    if has(folder, JOURNAL) && has_trials_left(folder) {
        console.announce(format_args!(
            "{0} is unfinished: trials of its protocol are left to do, and the results are those of the trials so far. Go on with: \
             ramphold resume {0}",
            folder.display()
        ));
    }
}

/// A session in a list.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct SessionSummary {
    /// Its folder.
    pub session: PathBuf,
    /// When it began, in UTC; `None` for a virtual session, and where nobody noted it.
    pub started_utc: Option<String>,
    /// The subject; `None` if `session.json` cannot be read.
    pub subject: Option<String>,
    /// Trials of status ok.
    pub trials_ok: usize,
    /// Trials in its table.
    pub trials: usize,
    /// How far it is.
    pub state: SessionState,
    /// What does not go together, of a doubtful session.
    pub reasons: Vec<String>,
}

impl SessionSummary {
    /// Looks at the session in `folder`. What is wrong with it makes it doubtful.
    pub fn of(folder: &Path) -> Self {
        let mut own = Self {
            session: folder.to_owned(),
            started_utc: None,
            subject: None,
            trials_ok: 0,
            trials: 0,
            state: SessionState::Doubtful,
            reasons: Vec::new(),
        };
        match SessionCard::read(folder) {
            Ok(card) => (own.started_utc, own.subject) = (card.about.started_utc, Some(card.subject.id)),
            Err(error) => own.reasons.push(error.to_string()),
        }
        let has = |name: &str| has(folder, name);
        // One that the operator ended has a manifest, too.
        let is_unfinished = has(JOURNAL) && (!has(MANIFEST) || has_trials_left(folder));
        match dataset::load(folder) {
            Ok(session) => {
                own.trials = session.trials.len();
                own.trials_ok = session.trials.iter().filter(|trial| trial.status == Status::Ok).count();
                let found = consistency::contradictions(&session);
                own.reasons.extend(found.iter().map(ToString::to_string));
            }
            // Of a session that has just begun, little is there.
            Err(_) if is_unfinished => {}
            Err(error) => own.reasons.push(error.to_string()),
        }
        if is_unfinished {
            own.state = SessionState::Unfinished;
            return own;
        }
        match foreign_results(folder) {
            Ok(found) => own.reasons.extend(found),
            Err(error) => own.reasons.push(error.to_string()),
        }
        match undescribed(folder) {
            Ok(found) => own.reasons.extend(found),
            Err(error) => own.reasons.push(error.to_string()),
        }
        own.reasons.dedup();
        if own.reasons.is_empty() {
            own.state = match (has("results/fit.json"), has("results/diagnosis.json")) {
                (_, true) => SessionState::Diagnosed,
                (true, false) => SessionState::Fitted,
                (false, false) => SessionState::Measured,
            };
        }
        own
    }
}
