//! Making the folder of a new session.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use sha2::{Digest, Sha256};

use super::SESSION_FORMAT;
use super::disk::Disk;
use super::journal::{JOURNAL_FORMAT, Journal, JournalEntry};
use super::recorder::{RecordError, RecordNames, Recorder};
use super::session_about::{SessionAbout, SubjectCard};
use crate::protocol::ValidProtocol;
use crate::schedule;
use crate::session::Settings;
use crate::session::rules::RULES;
use crate::wrist::Lever;

/// What is known of a session before it begins.
#[derive(Debug, Clone)]
pub struct NewSession<'a> {
    /// The protocol.
    pub protocol: &'a ValidProtocol,
    /// The order drawn.
    pub order: &'a [schedule::ScheduledTrial],
    /// Seed of every random draw.
    pub seed: u64,
    /// Who is measured.
    pub subject: &'a str,
    /// The lever of the rig.
    pub lever: Option<Lever>,
    /// The rig, with all that it takes to make it again.
    pub rig: &'a serde_json::Value,
    /// When, who and what; empty for a virtual session.
    pub about: &'a SessionAbout,
    /// Further fields of the subject.
    pub subject_fields: &'a Map<String, Value>,
    /// By how many samples the motor follows a command later than at the next sample.
    pub motion_delay_samples: u64,
}

/// `session.json` as this program writes it.
#[derive(Debug, Serialize, Deserialize)]
pub(super) struct Description {
    pub format: String,
    pub subject: SubjectCard,
    #[serde(flatten)]
    pub about: SessionAbout,
    sample_rate_hz: f64,
    rig: RigDescription,
    recorded_filter: Option<crate::signal::FilterSpec>,
    pub seed: u64,
    program: String,
}

#[derive(Debug, Serialize, Deserialize)]
struct RigDescription {
    lever: Option<Lever>,
}

/// The program and its version, as files name it.
pub const PROGRAM: &str = concat!("ramphold ", env!("CARGO_PKG_VERSION"));

impl NewSession<'_> {
    /// Makes the folder `path`, which must not be there, and everything that is known before the session begins.
    ///
    /// # Errors
    /// If the folder is there, or it cannot be written.
    pub fn create(&self, path: &Path, disk: Disk) -> Result<Recorder, RecordError> {
        let mut settings = Settings::new(self.protocol, self.seed, self.order)?;
        settings.motion_delay_samples = self.motion_delay_samples;
        let settings = Arc::new(settings);
        if path.symlink_metadata().is_ok() {
            return Err(RecordError::Exists(path.to_owned()));
        }
        // Made under another name, so that a folder with the session's name is a session that can be resumed.
        let beginning = beginning_of(path);
        let journal = self.prepare(&beginning, &disk)?;
        disk.rename(&beginning, path).map_err(|error| match error.kind() {
            std::io::ErrorKind::DirectoryNotEmpty | std::io::ErrorKind::AlreadyExists => {
                RecordError::Exists(path.to_owned())
            }
            _ => RecordError::at(path)(error),
        })?;
        Ok(Recorder::new(path, disk, journal, settings, RecordNames::default()))
    }

    fn prepare(&self, path: &Path, disk: &Disk) -> Result<Journal, RecordError> {
        make(disk, path)?;
        for folder in ["trials", "familiarisation", "before"] {
            if folder == "trials" || self.has(folder) {
                make(disk, &path.join(folder))?;
            }
        }
        let rate = self.protocol.signal.sample_rate_hz;
        let write = |name: &str, bytes: &[u8]| {
            let file = path.join(name);
            disk.write(&file, bytes).map_err(RecordError::at(&file))
        };
        write("protocol.json", self.protocol.text().as_bytes())?;
        write("schedule.csv", &self.schedule())?;
        write("rig.json", &pretty(self.rig))?;
        write("trials.csv", super::tables::empty())?;
        write("session.json", &pretty(&self.description(rate)))?;
        let file = path.join(super::JOURNAL);
        let mut journal = Journal::create(disk, path).map_err(RecordError::at(&file))?;
        journal.append(disk, &self.first_record()).map_err(RecordError::at(&file))?;
        Ok(journal)
    }

    fn has(&self, folder: &str) -> bool {
        let before = &self.protocol.before;
        match folder {
            "familiarisation" => before.familiarisation_trials > 0,
            _ => before.offset_s.is_some() || before.mvc.is_some(),
        }
    }

    fn schedule(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        // Writing into memory does not fail.
        let _ = schedule::write_csv(self.order, &mut bytes);
        bytes
    }

    fn description(&self, sample_rate_hz: f64) -> Description {
        Description {
            format: SESSION_FORMAT.to_owned(),
            subject: SubjectCard { id: self.subject.to_owned(), fields: self.subject_fields.clone() },
            about: self.about.clone(),
            sample_rate_hz,
            rig: RigDescription { lever: self.lever },
            recorded_filter: None,
            seed: self.seed,
            program: PROGRAM.to_owned(),
        }
    }

    fn first_record(&self) -> JournalEntry {
        JournalEntry::Session {
            format: JOURNAL_FORMAT.to_owned(),
            program: PROGRAM.to_owned(),
            seed: self.seed,
            protocol_sha256: sha256(self.protocol.text().as_bytes()),
            rules: RULES,
            motion_delay_samples: self.motion_delay_samples,
        }
    }
}

/// The hidden folder beside `path` in which a session is made ready.
fn beginning_of(path: &Path) -> PathBuf {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    path.with_file_name(format!(".{name}.{}.new", std::process::id()))
}

fn make(disk: &Disk, path: &Path) -> Result<(), RecordError> {
    disk.create_folder(path).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => RecordError::Exists(PathBuf::from(path)),
        _ => RecordError::at(path)(error),
    })
}

pub(super) fn pretty(value: &impl Serialize) -> Vec<u8> {
    // Values made by this program always have a JSON form.
    let mut bytes = serde_json::to_vec_pretty(value).unwrap_or_default();
    bytes.push(b'\n');
    bytes
}

/// SHA-256 in hexadecimal digits.
pub(super) fn sha256(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}
