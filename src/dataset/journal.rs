//! The journal: every event of the session, one a line, with its length and checksum before it.
//!
//! A line is `LENGTH CHECKSUM JSON\n`: the JSON's length in bytes as 8 hexadecimal digits, and the first 16 hexadecimal
//! digits of its SHA-256.

use std::fs::File;
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::disk::Disk;
use crate::session::{Event, Happening};

/// Name of the journal in a session folder.
pub const JOURNAL: &str = "journal.log";

/// Format and version of the journal.
pub const JOURNAL_FORMAT: &str = "ramphold-journal/1";

/// One line of the journal.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "record", rename_all = "snake_case")]
pub enum Record {
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
    },
    /// A step of the state machine that changed something.
    Happened(Happening),
    /// The operator said something that was not possible.
    Refused {
        /// Samples since the session was started or resumed.
        sample: u64,
        /// The word.
        word: Event,
    },
    /// The program had ended in the middle of the session and was started again; samples are counted anew.
    Resumed {
        /// The trial that was under way then, if there was one: it is aborted.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        interrupted: Option<Interrupted>,
    },
}

/// A trial that the program did not live to end.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Interrupted {
    /// Its number.
    pub number: u32,
    /// Samples in its record.
    pub samples: u64,
}

/// The journal, open for appending.
#[derive(Debug)]
pub struct Journal {
    file: File,
    line: Vec<u8>,
}

impl Journal {
    /// Begins a journal in a new file.
    pub fn create(disk: &Disk, folder: &Path) -> io::Result<Self> {
        let file = disk.create(&folder.join(JOURNAL))?;
        disk.sync_folder(folder)?;
        Ok(Self { file, line: Vec::with_capacity(512) })
    }

    /// Adds a record; it is on the disk when this returns.
    pub fn append(&mut self, disk: &Disk, record: &Record) -> io::Result<()> {
        const HEAD: usize = 8 + 1 + 16 + 1;
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
