//! The journal: every event of the session, one a line, with its length and checksum before it.
//!
//! A line is `LENGTH CHECKSUM JSON\n`: the JSON's length in bytes as 8 hexadecimal digits, and the first 16 hexadecimal
//! digits of its SHA-256.

mod read;

use std::collections::BTreeMap;
use std::fs::{File, TryLockError};
use std::io;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::audit::AuditEntry;
use super::disk::Disk;
use crate::files::Folder;
use crate::rig::Origin;
use crate::session::{Event, TransitionRecord};
use crate::timing::ClockStamp;

pub use read::{Damage, JournalLine, JournalText};

/// Name of the journal in a session folder.
pub const JOURNAL: &str = "journal.log";

/// Format and version of the journal.
pub const JOURNAL_FORMAT: &str = "ramphold-journal/1";

/// One line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "record", rename_all = "snake_case")]
pub enum JournalEntry {
    /// The first line.
    Session {
        /// Format and version.
        format: String,
        /// The program that wrote it, with its version.
        program: String,
        /// Seed of the session.
        seed: u64,
        /// SHA-256 of the protocol.
        protocol_sha256: String,
        /// Number of the rules of the session; records of the first ones do not say so.
        #[serde(default = "first_rules")]
        rules: u32,
        /// By how many samples the motor follows a command later than at the next sample; the virtual wrist does not.
        #[serde(default, skip_serializing_if = "is_none")]
        motion_delay_samples: u64,
        /// SHA-256 of the other files that the session was begun with; older journals have none.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        files_sha256: BTreeMap<String, String>,
    },
    /// A record of samples is complete and has its name.
    Recorded(RecordSum),
    /// A transition of the state machine.
    #[serde(rename = "happened")]
    Transition(TransitionRecord),
    /// A command of the operator that was not possible in its phase.
    Refused {
        /// Samples since the session was started or resumed.
        sample: u64,
        /// The command.
        #[serde(rename = "word")]
        command: Event,
    },
    /// The rig was armed, and knew its start position in this way.
    Origin {
        /// Samples since the session was started or resumed.
        sample: u64,
        /// How the start position was known.
        origin: Origin,
    },
    /// When a sample was had: the first of a stretch, or of a trial.
    Clock {
        /// Samples since the session was started or resumed, this one included: one more than a transition at it has.
        sample: u64,
        /// The moment on the clocks of the computer.
        stamp: ClockStamp,
    },
    /// An action of an operator at a console.
    Console(AuditEntry),
    /// The session was resumed after the program had ended; samples are counted from 0 again.
    Resumed {
        /// The trial that was under way when the program ended, now aborted.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        interrupted: Option<Interrupted>,
        /// SHA-256 of the files that the session rests on, where the journal had none before.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        files_sha256: BTreeMap<String, String>,
    },
}

fn is_none(samples: &u64) -> bool {
    *samples == 0
}

fn first_rules() -> u32 {
    1
}

/// A complete record: everything the session says later rests on these bytes.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RecordSum {
    /// Path in the session folder.
    pub file: String,
    /// Length.
    pub bytes: u64,
    /// SHA-256 in hexadecimal digits.
    pub sha256: String,
}

/// A trial or rig trial that was under way when the program ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interrupted {
    /// Its number.
    pub number: u32,
    /// Samples in its record.
    pub samples: u64,
    /// Whether it is a rig trial.
    #[serde(default, skip_serializing_if = "is_false")]
    pub is_rig_trial: bool,
}

fn is_false(value: &bool) -> bool {
    !value
}

/// Length of what comes before a record's JSON.
const HEAD: usize = 8 + 1 + 16 + 1;

/// The journal, open for appending. As long as it is open, its file is locked: the lock is the operating system's and
/// ends with the program, however that ends, so it cannot be left behind.
#[derive(Debug)]
pub struct Journal {
    file: File,
    line: Vec<u8>,
}

impl Journal {
    /// Begins a journal in a new file.
    pub fn create(disk: &Disk, folder: &Folder) -> io::Result<Self> {
        let file = disk.create(folder, JOURNAL)?;
        lock(&file)?;
        disk.sync_names(folder, JOURNAL)?;
        Ok(Self { file, line: Vec::with_capacity(512) })
    }

    /// Opens the journal that is in `folder`. [`io::ErrorKind::WouldBlock`] says that another program has it open.
    pub fn open(disk: &Disk, folder: &Folder) -> io::Result<Self> {
        let file = disk.open(folder, JOURNAL)?;
        lock(&file)?;
        Ok(Self { file, line: Vec::with_capacity(512) })
    }

    /// Cuts off everything from `length` on.
    pub fn cut(&mut self, disk: &Disk, length: u64) -> io::Result<()> {
        disk.cut(&self.file, length)?;
        disk.sync(&self.file)
    }

    /// Adds a record; it is on the disk when this returns, unless `disk` is synchronised at the end.
    pub fn append(&mut self, disk: &Disk, record: &JournalEntry) -> io::Result<()> {
        self.line.clear();
        self.line.resize(HEAD, b' ');
        serde_json::to_writer(&mut self.line, record)?;
        let head = head(&self.line[HEAD..]);
        self.line[..HEAD].copy_from_slice(head.as_bytes());
        self.line.push(b'\n');
        disk.append(&mut self.file, &self.line)?;
        disk.sync(&self.file)
    }
}

fn lock(file: &File) -> io::Result<()> {
    match file.try_lock() {
        Ok(()) => Ok(()),
        Err(TryLockError::WouldBlock) => Err(io::Error::from(io::ErrorKind::WouldBlock)),
        // A file system that knows no locks cannot say that someone else is at work; it is no reason not to measure.
        Err(TryLockError::Error(error)) if error.kind() == io::ErrorKind::Unsupported => Ok(()),
        Err(TryLockError::Error(error)) => Err(error),
    }
}

/// Length and checksum of a record's JSON, each with a blank behind it.
fn head(json: &[u8]) -> String {
    use std::fmt::Write;
    let mut head = format!("{:08x} ", json.len());
    for byte in &Sha256::digest(json)[..8] {
        let _ = write!(head, "{byte:02x}");
    }
    head.push(' ');
    head
}
