//! The sessions of a laboratory and how far each is, read in the background.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};

use crate::console::{ListedSession, lower_thread_priority};
use crate::dataset::{is_session, session_folders};
use crate::files::Folder;

use super::session_state::SessionSummary;

/// Reads the sessions in a folder; dropped, it stops.
pub struct LaboratorySessions {
    found: Arc<Mutex<Option<Vec<ListedSession>>>>,
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
        self.found.lock().unwrap_or_else(PoisonError::into_inner).clone()
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

fn sessions(folder: &Path, stop: &AtomicBool) -> Vec<ListedSession> {
    let mut folders = session_folders(&[folder.to_owned()]).unwrap_or_else(|error| {
        tracing::warn!("{error}");
        Vec::new()
    });
    folders.retain(|folder| Folder::open(folder).is_ok_and(|folder| is_session(&folder)));
    folders.sort_by(|a, b| natord::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    folders.iter().take_while(|_| !stop.load(Ordering::Relaxed)).map(|folder| listed(folder)).collect()
}

fn listed(folder: &Path) -> ListedSession {
    let summary = SessionSummary::of(folder);
    ListedSession {
        session: folder.file_name().unwrap_or_default().to_string_lossy().into_owned(),
        started_utc: summary.started_utc,
        subject: summary.subject,
        trials: [summary.trials_ok, summary.trials],
        state: summary.state.name(),
        reasons: summary.reasons,
    }
}
