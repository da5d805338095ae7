//! Replay of a session: the recorded samples and commands go through the state machine again, and its transitions are
//! compared with the journal.
//!
//! Between the records (rests, the way back) no samples are kept. Nothing the session does there depends on them but
//! faults, and those are in the journal, so a motor that follows stands in for them. The limits are held against every
//! sample that was kept.

use std::path::Path;

pub use self::difference::Difference;
use self::expected_step::{ExpectedStep, is_under_way};
pub use self::garbage::Garbage;
use self::replayer::Replayer;
pub use self::replayer::StepObserver;
use super::error::DatasetError;
use super::journal::{JOURNAL, JournalEntry};
use super::recovery::{RecoveredSession, RecoveredState};
use crate::session::rules::{RULES, RuleChange, changes_since};

mod difference;
mod expected_step;
mod garbage;
mod recorded_samples;
mod replayer;

/// Result of a replay.
#[derive(Debug, Clone, PartialEq)]
pub struct Replay {
    /// Steps of the state machine.
    pub steps: u64,
    /// Events that are the same as in the journal.
    pub events: usize,
    /// How often the session was started: once, and once more for every time it was resumed.
    pub starts: usize,
    /// First difference from the record.
    pub difference: Option<Difference>,
    /// Files that are not as the journal has them, with what became of each.
    pub changed_files: Vec<String>,
    /// Bytes behind the journal or a record that belong to neither.
    pub garbage: Vec<Garbage>,
    /// The program that recorded it.
    pub program: String,
    /// The rules in force when it was recorded.
    pub rules: u32,
}

impl Replay {
    /// What has changed in the rules since the session was recorded.
    pub fn changed_rules(&self) -> impl Iterator<Item = &'static RuleChange> {
        changes_since(self.rules)
    }

    /// Whether the session came out as recorded, from files that are as they were.
    pub fn is_sound(&self) -> bool {
        self.difference.is_none()
            && self.changed_files.is_empty()
            && self.garbage.iter().all(|garbage| garbage.is_torn_end)
    }

    /// Whether the session was recorded by rules that this program does not know yet.
    pub fn is_from_the_future(&self) -> bool {
        self.rules > RULES
    }
}

/// Goes through the session in `folder` again, up to the first difference.
///
/// # Errors
/// If the folder cannot be read, or its journal is damaged in the middle.
pub fn replay(folder: &Path) -> Result<Replay, DatasetError> {
    replay_session(folder, None)
}

/// As [`replay`], calling `observer` after each step.
///
/// # Errors
/// As [`replay`].
pub fn replay_watched(folder: &Path, observer: &mut StepObserver) -> Result<Replay, DatasetError> {
    replay_session(folder, Some(observer))
}

fn replay_session(folder: &Path, mut observer: Option<&mut StepObserver>) -> Result<Replay, DatasetError> {
    let session = RecoveredSession::read(folder)?;
    session.undamaged()?;
    let mut state = RecoveredState::new(&session.settings);
    let mut replay = Replay {
        steps: 0,
        events: 0,
        starts: 0,
        difference: None,
        changed_files: session.changed_files()?,
        garbage: Vec::new(),
        program: session.program.clone(),
        rules: session.rules,
    };
    let records: Vec<&JournalEntry> = session.journal.records.iter().map(|placed| &placed.record).collect();
    if let Some(torn) = &session.journal.torn {
        let lines: Vec<ExpectedStep> = records.iter().filter_map(|record| ExpectedStep::of(record)).collect();
        let is_torn_end = is_under_way(&lines);
        replay.garbage.push(Garbage { file: session.folder.name(JOURNAL), bytes: torn.length, is_torn_end });
    }
    // The first record describes the session.
    for part in records[1..].split_inclusive(|record| matches!(record, JournalEntry::Resumed { .. })) {
        let resumed = part.last().filter(|record| matches!(record, JournalEntry::Resumed { .. }));
        let lines: Vec<ExpectedStep> = part.iter().filter_map(|record| ExpectedStep::of(record)).collect();
        replay.starts += 1;
        let mut player = Replayer::new(&session, state, replay.starts);
        player.ended_well = resumed.is_none() && !is_under_way(&lines);
        let played = player.play(&lines, observer.as_deref_mut())?;
        replay.garbage.append(&mut player.garbage);
        replay.steps += player.machine.sample();
        replay.events += player.events;
        if player.is_stopped {
            return Ok(replay);
        }
        if let Some(difference) = played {
            replay.difference = Some(difference);
            return Ok(replay);
        }
        state = player.state;
        if let Some(record) = resumed {
            state.apply(record);
        }
    }
    Ok(replay)
}

#[cfg(test)]
mod tests;
