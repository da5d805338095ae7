//! State of a session recovered from its folder, to resume or replay the session.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::SESSION_FORMAT;
use super::audit::AuditEntry;
use super::csv_input::SessionFolder;
use super::description_json::parse_json;
use super::error::{DatasetError, FilePlace};
use super::folder::{Description, sha256};
use super::journal::{JOURNAL, JOURNAL_FORMAT, JournalEntry, JournalText};
use super::recorder::RecordNames;
use crate::protocol::ValidProtocol;
use crate::rig::Origin;
use crate::schedule;
use crate::session::{Phase, Progress, RecordTarget, Settings};

/// A session as recovered from its folder.
#[derive(Debug)]
pub(super) struct RecoveredSession {
    pub path: PathBuf,
    pub subject: String,
    pub settings: Arc<Settings>,
    pub journal: JournalText,
    /// Program that started the session.
    pub program: String,
    /// Version of the session's rules at that time.
    pub rules: u32,
}

impl RecoveredSession {
    /// Reads description, protocol, order and journal.
    pub fn read(path: &Path) -> Result<Self, DatasetError> {
        let folder = SessionFolder::open(path)?;
        let text = folder.text("session.json", None)?;
        let at = || FilePlace::file(folder.name(JOURNAL));
        let bytes = fs::read(path.join(JOURNAL)).map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => {
                DatasetError::NoJournal { at: at(), problem: "not found".to_owned() }
            }
            _ => DatasetError::Unreadable { at: at(), source },
        })?;
        let journal = JournalText::parse(&bytes);
        let Some(JournalEntry::Session {
            format,
            program,
            seed,
            protocol_sha256,
            rules,
            motion_delay_samples,
        }) = journal.records.first().map(|placed| &placed.record)
        else {
            let problem = "its first record is not there or not readable".to_owned();
            return Err(DatasetError::NoJournal { at: at(), problem });
        };
        if format != JOURNAL_FORMAT {
            return Err(DatasetError::UnknownFormat {
                at: at(),
                found: format.clone(),
                expected: JOURNAL_FORMAT,
            });
        }
        let about: Description = parse_json(&folder.name("session.json"), &text)?;
        if about.format != SESSION_FORMAT {
            let at = FilePlace::field(folder.name("session.json"), "format");
            return Err(DatasetError::UnknownFormat { at, found: about.format, expected: SESSION_FORMAT });
        }
        let (seed, program, rules, delay) = (*seed, program.clone(), *rules, *motion_delay_samples);
        let protocol = folder.text("protocol.json", None)?;
        let found = sha256(protocol.as_bytes());
        if found != *protocol_sha256 {
            return Err(DatasetError::ProtocolChanged {
                at: FilePlace::file(folder.name("protocol.json")),
                found,
                expected: protocol_sha256.clone(),
            });
        }
        let protocol = ValidProtocol::parse(&protocol, &folder.name("protocol.json"))?;
        let order = order(&folder)?;
        let mut settings = Settings::new(&protocol, seed, &order).map_err(|error| DatasetError::Value {
            at: FilePlace::file(folder.name("schedule.csv")),
            found: error.to_string(),
            expected: "an order of the protocol's trials".to_owned(),
        })?;
        settings.motion_delay_samples = delay;
        let subject = about.subject.id;
        Ok(Self { path: path.to_owned(), subject, settings: Arc::new(settings), journal, program, rules })
    }

    /// The first damage in the middle of the journal as an error, if there is any.
    pub fn undamaged(&self) -> Result<(), DatasetError> {
        let Some(damage) = self.journal.damage.first() else { return Ok(()) };
        Err(DatasetError::Damaged {
            at: FilePlace::file(self.path.join(JOURNAL).display().to_string()),
            offset: damage.offset,
            length: damage.length,
            reason: damage.reason.clone(),
        })
    }
}

/// Operators' actions in the session in `folder`, each with the number of the start of the session, from 1.
///
/// # Errors
/// If the folder cannot be read.
pub fn operator_actions(folder: &Path) -> Result<Vec<(usize, AuditEntry)>, DatasetError> {
    let session = RecoveredSession::read(folder)?;
    let mut start = 1;
    let mut found = Vec::new();
    for placed in session.journal.records {
        match placed.record {
            JournalEntry::Resumed { .. } => start += 1,
            JournalEntry::Console(entry) => found.push((start, entry)),
            _ => {}
        }
    }
    Ok(found)
}

/// The order that was drawn when the session began.
fn order(folder: &SessionFolder) -> Result<Vec<schedule::ScheduledTrial>, DatasetError> {
    let text = folder.text("schedule.csv", None)?;
    let rows = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
    rows.map(|row| {
        row.map_err(|error: csv::Error| DatasetError::Value {
            at: FilePlace {
                file: folder.name("schedule.csv").into(),
                line: error.position().map(csv::Position::line),
                column: None,
            },
            found: error.to_string(),
            expected: "position,velocity_rad_s,torque_nm,repetition of a trial".to_owned(),
        })
    })
    .collect()
}

/// State of a session after a part of its journal.
#[derive(Debug, Clone)]
pub(super) struct RecoveredState {
    pub progress: Progress,
    pub names: RecordNames,
    pub phase: Phase,
    /// File of the record that was being written.
    pub open: Option<String>,
    /// How the rig knew its start position when it was armed last.
    pub origin: Option<Origin>,
    /// Whether the rig was ever armed.
    pub was_armed: bool,
}

impl RecoveredState {
    /// The state before the first transition.
    pub fn new(settings: &Settings) -> Self {
        Self {
            progress: Progress::new(settings),
            names: RecordNames::default(),
            phase: Phase::Ready,
            open: None,
            origin: None,
            was_armed: false,
        }
    }

    /// Applies one entry of the journal.
    pub fn apply(&mut self, record: &JournalEntry) {
        match record {
            JournalEntry::Session { .. } | JournalEntry::Refused { .. } | JournalEntry::Console(_) => {}
            JournalEntry::Origin { origin, .. } => self.origin = Some(*origin),
            JournalEntry::Transition(transition) => {
                let before = self.progress.record_target(self.phase);
                self.progress.apply(transition);
                self.phase = transition.to;
                self.was_armed |= self.phase.is_armed();
                let now = self.progress.record_target(self.phase);
                if now == RecordTarget::None {
                    self.open = None;
                } else if now != before {
                    self.open = self.names.next(now, &self.progress);
                }
            }
            JournalEntry::Resumed { interrupted } => {
                self.progress.interrupt(interrupted.map_or(0, |trial| trial.samples));
                self.phase = Phase::Ready;
                self.open = None;
            }
        }
    }
}
