//! State of a session recovered from its folder, to resume or replay the session.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;

use super::SESSION_FORMAT;
use super::audit::AuditEntry;
use super::csv_input::SessionFolder;
use super::description_json::{check_format, parse_json};
use super::error::{DatasetError, FilePlace};
use super::folder::Description;
use super::journal::{JOURNAL, JOURNAL_FORMAT, JournalEntry, JournalText};
use super::recorder::RecordNames;
use super::stored_protocol::{check_unchanged, read_protocol};
use crate::files::{excerpt, limits};
use crate::rig::Origin;
use crate::schedule;
use crate::session::rules::RULES;
use crate::session::{
    Phase, Progress, RecordTarget, Settings, TransitionDetail, TransitionRecord, transitions,
};

/// A session as recovered from its folder.
#[derive(Debug)]
pub(super) struct RecoveredSession {
    pub folder: SessionFolder,
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
        let text = folder.text("session.json", limits::SETTINGS_BYTES, None)?;
        let at = || FilePlace::file(folder.name(JOURNAL));
        let bytes =
            folder.folder().read(JOURNAL, limits::JOURNAL_BYTES).map_err(|source| match source.kind() {
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
            ..
        }) = journal.records.first().map(|placed| &placed.record)
        else {
            let problem = "its first record is not there or not readable".to_owned();
            return Err(DatasetError::NoJournal { at: at(), problem });
        };
        check_format(at, format, JOURNAL_FORMAT)?;
        let about: Description = parse_json(&folder.name("session.json"), &text)?;
        let format_at = || FilePlace::field(folder.name("session.json"), "format");
        check_format(format_at, &about.format, SESSION_FORMAT)?;
        let (seed, program, rules, delay) = (*seed, program.clone(), *rules, *motion_delay_samples);
        let (protocol, text) = read_protocol(&folder)?;
        check_unchanged(&folder, &text, protocol_sha256)?;
        let order = order(&folder)?;
        let mut settings = Settings::new(&protocol, seed, &order).map_err(|error| DatasetError::Value {
            at: FilePlace::file(folder.name("schedule.csv")),
            found: error.to_string(),
            expected: "an order of the protocol's trials".to_owned(),
        })?;
        settings.motion_delay_samples = delay;
        let subject = about.subject.id;
        Ok(Self { folder, subject, settings: Arc::new(settings), journal, program, rules })
    }

    /// SHA-256 of every file that the session rests on, as the journal has it: of the last record where a file has several.
    pub fn sums(&self) -> BTreeMap<&str, &str> {
        let mut sums = BTreeMap::new();
        for placed in &self.journal.records {
            match &placed.record {
                JournalEntry::Session { files_sha256, .. } | JournalEntry::Resumed { files_sha256, .. } => {
                    let known = files_sha256.iter().filter(|(file, _)| BEGUN_WITH.contains(&file.as_str()));
                    sums.extend(known.map(|(file, sum)| (file.as_str(), sum.as_str())));
                }
                JournalEntry::Recorded(record) => {
                    sums.insert(&record.file, &record.sha256);
                }
                _ => {}
            }
        }
        sums
    }

    /// Whether the journal has the sums of the files that the session was begun with; those of older versions do not.
    pub fn has_sums(&self) -> bool {
        self.sums().keys().any(|file| BEGUN_WITH.contains(file))
    }

    /// The sums of the files that the session was begun with, as they are now.
    pub fn present_sums(&self) -> Result<BTreeMap<String, String>, DatasetError> {
        let sum = |file: &&str| {
            let (_, sum) =
                self.folder.folder().sum(file).map_err(|source| self.folder.unreadable(file, source))?;
            Ok(((*file).to_owned(), sum))
        };
        BEGUN_WITH.iter().filter(|file| self.folder.folder().contains(file)).map(sum).collect()
    }

    /// Every file that is not as the journal has it, with what became of it.
    pub fn changed_files(&self) -> Result<Vec<String>, DatasetError> {
        let mut changed = Vec::new();
        for (file, noted) in self.sums() {
            match self.folder.folder().sum(file) {
                Ok((_, sum)) if sum == noted => {}
                Ok(_) => changed.push(format!("{} changed", excerpt(file))),
                Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                    changed.push(format!("{} missing", excerpt(file)));
                }
                Err(source) => return Err(self.folder.unreadable(&excerpt(file), source)),
            }
        }
        Ok(changed)
    }

    /// The state after all records of the journal.
    ///
    /// # Errors
    /// If a record cannot have followed those before it.
    pub fn state(&self) -> Result<RecoveredState, DatasetError> {
        self.state_through(|_| {})
    }

    /// As [`RecoveredSession::state`]; `seen` gets the state after each record of the journal.
    pub fn state_through(
        &self,
        mut seen: impl FnMut(&RecoveredState),
    ) -> Result<RecoveredState, DatasetError> {
        let mut state = RecoveredState::new(&self.settings);
        for (number, placed) in self.journal.records.iter().enumerate() {
            state.check(&placed.record, number == 0, self.rules).map_err(|problem| {
                let at = FilePlace::file(self.folder.name(JOURNAL));
                DatasetError::JournalOrder { at, offset: placed.offset, problem }
            })?;
            state.apply(&placed.record);
            seen(&state);
        }
        Ok(state)
    }

    /// The first damage in the middle of the journal as an error, if there is any.
    pub fn undamaged(&self) -> Result<(), DatasetError> {
        let Some(damage) = self.journal.damage.first() else { return Ok(()) };
        Err(DatasetError::Damaged {
            at: FilePlace::file(self.folder.name(JOURNAL)),
            offset: damage.offset,
            length: damage.length,
            reason: damage.reason.clone(),
        })
    }
}

/// The files that a session is begun with, but for the protocol, whose sum has a field of its own.
const BEGUN_WITH: [&str; 3] = ["rig.json", "schedule.csv", "session.json"];

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
    let text = folder.text("schedule.csv", limits::TABLE_BYTES, None)?;
    let rows = csv::Reader::from_reader(text.as_bytes()).into_deserialize();
    rows.enumerate()
        .map(|(row_number, row)| {
            if row_number == limits::MAX_SESSION_TRIALS {
                let at = FilePlace::file(folder.name("schedule.csv"));
                return Err(DatasetError::TooMany { at, what: "trials", limit: limits::MAX_SESSION_TRIALS });
            }
            row.map_err(|error: csv::Error| DatasetError::Value {
                at: FilePlace {
                    file: folder.name("schedule.csv").into(),
                    line: error.position().map(csv::Position::line),
                    column: None,
                },
                found: excerpt(&error.to_string()).into_owned(),
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
    /// Files of every record that was begun.
    pub begun: BTreeSet<String>,
    /// How the rig knew its start position when it was armed last.
    pub origin: Option<Origin>,
    /// Whether the rig was ever armed.
    pub was_armed: bool,
    /// Sample of the last record since the session was started or resumed.
    sample: u64,
}

impl RecoveredState {
    /// The state before the first transition.
    pub fn new(settings: &Settings) -> Self {
        Self {
            progress: Progress::new(settings),
            names: RecordNames::default(),
            phase: Phase::Ready,
            open: None,
            begun: BTreeSet::new(),
            origin: None,
            was_armed: false,
            sample: 0,
        }
    }

    /// What is wrong with an entry as the next one of the journal.
    pub fn check(&self, record: &JournalEntry, is_first: bool, rules: u32) -> Result<(), String> {
        if matches!(record, JournalEntry::Session { .. }) != is_first {
            return Err("begins a session a second time".to_owned());
        }
        let sample = match record {
            JournalEntry::Transition(TransitionRecord { sample, .. })
            | JournalEntry::Refused { sample, .. } => *sample,
            _ => self.sample,
        };
        if sample < self.sample {
            return Err(format!("is of sample {sample}, but follows one of sample {}", self.sample));
        }
        match record {
            JournalEntry::Transition(transition) => self.check_transition(transition, rules),
            JournalEntry::Recorded(record) if self.open.as_ref() != Some(&record.file) => {
                let open = self.open.as_deref().unwrap_or("none");
                Err(format!(
                    "is of the record {}, but {open} was the one that it could be of",
                    excerpt(&record.file)
                ))
            }
            _ => Ok(()),
        }
    }

    fn check_transition(&self, transition: &TransitionRecord, rules: u32) -> Result<(), String> {
        let TransitionRecord { from, event, to, .. } = transition;
        if *from != self.phase {
            return Err(format!(
                "leaves the state {}, but the session was in {}",
                from.name(),
                self.phase.name()
            ));
        }
        // The table of older rules may have had other lines.
        if rules == RULES && !transitions::lines(*from, *event).any(|line| line.to == *to) {
            return Err(format!(
                "goes from {} to {} by {}, which no session does",
                from.name(),
                to.name(),
                event.name()
            ));
        }
        let expected = match &transition.detail {
            Some(TransitionDetail::Began { number, .. }) => Some((*number, self.progress.next_number())),
            Some(TransitionDetail::Ended { number, .. }) => {
                Some((*number, self.progress.under_way().unwrap_or(0)))
            }
            _ => None,
        };
        match expected {
            Some((number, expected)) if number != expected => {
                Err(format!("is of trial {number}, but trial {expected} was the one that it could be of"))
            }
            _ => Ok(()),
        }
    }

    /// Applies one entry of the journal.
    pub fn apply(&mut self, record: &JournalEntry) {
        match record {
            JournalEntry::Session { .. } | JournalEntry::Console(_) | JournalEntry::Recorded(_) => {}
            JournalEntry::Refused { sample, .. } => self.sample = *sample,
            JournalEntry::Clock { .. } => {}
            JournalEntry::Origin { origin, .. } => self.origin = Some(*origin),
            JournalEntry::Transition(transition) => {
                let before = self.progress.record_target(self.phase);
                self.sample = transition.sample;
                self.progress.apply(transition);
                self.phase = transition.to;
                self.was_armed |= self.phase.is_armed();
                let now = self.progress.record_target(self.phase);
                if now == RecordTarget::None {
                    self.open = None;
                } else if now != before {
                    self.open = self.names.next(now, &self.progress);
                    self.begun.extend(self.open.clone());
                }
            }
            JournalEntry::Resumed { interrupted, .. } => {
                self.sample = 0;
                self.progress.interrupt(interrupted.map_or(0, |trial| trial.samples));
                self.phase = Phase::Ready;
                self.open = None;
            }
        }
    }
}
