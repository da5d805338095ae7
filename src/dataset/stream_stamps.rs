//! When the time stamps of a stream of a session could not be when its samples were taken.

use std::ops::Range;
use std::path::Path;

use super::audit::OperatorAction;
use super::error::DatasetError;
use super::journal::{JournalEntry, JournalText};
use super::recovery::RecoveredSession;

/// The samples, counted from 0, whose stamps may be off: of a `stream` in the `run`th run of the program, counted from 1, on the session in
/// `folder`.
///
/// # Errors
/// If the session cannot be read.
pub fn samples_with_stamps_off(
    folder: &Path,
    stream: &str,
    run: usize,
) -> Result<Vec<Range<usize>>, DatasetError> {
    Ok(of_journal(&RecoveredSession::read(folder)?.journal, stream, run))
}

fn of_journal(journal: &JournalText, stream: &str, run: usize) -> Vec<Range<usize>> {
    let mut spans: Vec<Range<usize>> = Vec::new();
    let mut present_run = 1;
    for placed in &journal.records {
        match &placed.record {
            JournalEntry::Resumed { .. } => present_run += 1,
            JournalEntry::Console(entry) if present_run == run => match &entry.action {
                OperatorAction::StreamStampsOff { stream: own, after_samples, .. } if own == stream => {
                    spans.push(*after_samples as usize..usize::MAX);
                }
                OperatorAction::StreamStampsRight { stream: own, after_samples } if own == stream => {
                    if let Some(last) = spans.last_mut() {
                        last.end = *after_samples as usize;
                    }
                }
                _ => {}
            },
            _ => {}
        }
    }
    spans
}
