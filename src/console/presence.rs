//! Whether an operator's page is open.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Counts the operators' pages that are open. Clones share the count.
#[derive(Debug, Clone)]
pub struct Presence {
    state: Arc<Mutex<PresenceState>>,
    timeout: Option<Duration>,
}

#[derive(Debug, Default)]
struct PresenceState {
    pages: usize,
    /// Time since which no page has been open, after there was one.
    absent_since: Option<Instant>,
}

impl Presence {
    /// No page is open yet. With a `timeout`, [`Presence::is_missed`] reports a longer absence.
    pub fn new(timeout: Option<Duration>) -> Self {
        Self { state: Arc::default(), timeout }
    }

    /// Counts a page that was opened.
    pub fn opened(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        *state = PresenceState { pages: state.pages + 1, absent_since: None };
    }

    /// Counts a page that was closed.
    pub fn closed(&self) {
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        state.pages = state.pages.saturating_sub(1);
        state.absent_since = (state.pages == 0).then(Instant::now);
    }

    /// The timeout, once for each absence that is longer than it.
    pub fn is_missed(&self) -> Option<Duration> {
        let timeout = self.timeout?;
        let mut state = self.state.lock().unwrap_or_else(PoisonError::into_inner);
        let missed = state.absent_since.is_some_and(|since| since.elapsed() >= timeout);
        if missed {
            state.absent_since = None;
        }
        missed.then_some(timeout)
    }
}
