//! The sessions of a laboratory and how far each is, read in the background.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use crate::console::{ListedSession, lower_thread_priority};
use crate::dataset::{is_session, session_folders};
use crate::files::Folder;

use super::session_state::{SessionState, SessionSummary};

/// A session: its folder, and what the page shows of it.
type FoundSession = (PathBuf, ListedSession);

/// Reads the sessions in a folder; dropped, it stops.
pub struct LaboratorySessions {
    found: Arc<Mutex<Option<Vec<FoundSession>>>>,
    stop: Arc<AtomicBool>,
    reader: Option<JoinHandle<()>>,
}

impl LaboratorySessions {
    /// Begins to read the sessions in `folder`.
    pub fn read(folder: PathBuf) -> Self {
        let (found, stop) = (Arc::new(Mutex::new(None)), Arc::new(AtomicBool::new(false)));
        let (list, stopped) = (found.clone(), stop.clone());
        let reader = thread::Builder::new().name("sessions".to_owned()).spawn(move || {
            lower_thread_priority();
            let sessions = sessions(&folder, &stopped);
            *list.lock().unwrap_or_else(PoisonError::into_inner) = Some(sessions);
        });
        if let Err(error) = &reader {
            tracing::warn!("the sessions are not listed: {error}");
        }
        Self { found, stop, reader: reader.ok() }
    }

    /// The sessions; `None` while they are being read.
    pub fn found(&self) -> Option<Vec<ListedSession>> {
        let found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        Some(found.as_ref()?.iter().map(|(_, listed)| listed.clone()).collect())
    }

    /// Folder and subject of the unfinished session of that name; `None` where the list has no such one, or several.
    pub fn unfinished(&self, name: &str) -> Option<(PathBuf, Option<String>)> {
        let found = self.found.lock().unwrap_or_else(PoisonError::into_inner);
        let mut named = found.as_ref()?.iter().filter(|(_, listed)| listed.session == name);
        let (folder, listed) = named.next()?;
        let is_it = named.next().is_none() && listed.state == SessionState::Unfinished.name();
        is_it.then(|| (folder.clone(), listed.subject.clone()))
    }
}

impl Drop for LaboratorySessions {
    fn drop(&mut self) {
        self.stop.store(true, Ordering::Relaxed);
        if let Some(reader) = self.reader.take() {
            // If the thread panicked, it has said so.
            let _ = reader.join();
        }
    }
}

fn sessions(folder: &Path, stop: &AtomicBool) -> Vec<FoundSession> {
    let mut folders = session_folders(&[folder.to_owned()]).unwrap_or_else(|error| {
        tracing::warn!("{error}");
        Vec::new()
    });
    folders.retain(|folder| Folder::open(folder).is_ok_and(|folder| is_session(&folder)));
    folders.sort_by(|a, b| natord::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    folders.into_iter().take_while(|_| !stop.load(Ordering::Relaxed)).map(listed).collect()
}

fn listed(folder: PathBuf) -> FoundSession {
    let summary = SessionSummary::of(&folder);
    let listed = ListedSession {
        session: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        started_utc: summary.started_utc,
        subject: summary.subject,
        trials: [summary.trials_ok, summary.trials],
        state: summary.state.name(),
        reasons: summary.reasons,
    };
    (folder, listed)
}
