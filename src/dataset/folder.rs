//! Making the folder of a new session.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::disk::Disk;
use super::hexadecimal::sha256;
use super::journal::{JOURNAL_FORMAT, Journal, JournalEntry};
use super::recorder::{RecordError, RecordNames, Recorder};
use super::session_about::{SessionAbout, SubjectCard};
use super::tables;
use super::{RIG_CALIBRATION, SESSION_FORMAT};
use crate::files::{self, Folder};
use crate::json_file;
use crate::protocol::ValidProtocol;
use crate::rig::{RecordedChannel, RecordedSignals};
use crate::schedule;
use crate::session::Settings;
use crate::session::rules::RULES;
use crate::signal::FilterSpec;
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
    /// The file of the rig's measured constants, byte for byte, if there is one.
    pub calibration: Option<&'a [u8]>,
    /// When, who and what; empty for a virtual session.
    pub about: &'a SessionAbout,
    /// Further fields of the subject.
    pub subject_fields: &'a Map<String, Value>,
    /// What the rig does to its signals before they are recorded.
    pub signals: &'a RecordedSignals,
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
    recorded_filter: Option<FilterSpec>,
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    channels: BTreeMap<String, RecordedChannel>,
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
        if files::exists(path) {
            return Err(RecordError::Exists(path.to_owned()));
        }
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
            let unnamed =
                std::io::Error::new(std::io::ErrorKind::InvalidInput, "it has no name that is text");
            return Err(RecordError::at(path)(unnamed));
        };
        let above = path.parent().unwrap_or(Path::new(""));
        let above = Folder::open(above).map_err(RecordError::at(above))?;
        // Made under another name, so that a folder with the session's name is a session that can be resumed.
        let beginning = format!(".{name}.{}.new", std::process::id());
        let folder = make(&disk, &above, &beginning)?;
        let journal = self.prepare(&folder, &disk)?;
        disk.rename(&above, &beginning, name).map_err(|error| match error.kind() {
            std::io::ErrorKind::DirectoryNotEmpty | std::io::ErrorKind::AlreadyExists => {
                RecordError::Exists(path.to_owned())
            }
            _ => RecordError::at(path)(error),
        })?;
        Ok(Recorder::new(folder.renamed(path), disk, journal, settings, RecordNames::default()))
    }

    fn prepare(&self, folder: &Folder, disk: &Disk) -> Result<Journal, RecordError> {
        for inside in ["trials", "familiarisation", "before", tables::RIG_FOLDER] {
            if inside == "trials" || self.has(inside) {
                make(disk, folder, inside)?;
            }
        }
        let rate = self.protocol.signal.sample_rate_hz;
        let mut sums = BTreeMap::new();
        for (name, bytes) in [
            ("protocol.json", self.protocol.text().as_bytes()),
            ("schedule.csv", &self.schedule()),
            ("rig.json", json_file::pretty(self.rig).as_bytes()),
            ("trials.csv", tables::empty()),
            (tables::RIG_TABLE, tables::empty_rig_table()),
            ("session.json", json_file::pretty(&self.description(rate)).as_bytes()),
        ] {
            if name == tables::RIG_TABLE && !self.has(tables::RIG_FOLDER) {
                continue;
            }
            disk.write(folder, name, bytes).map_err(RecordError::at(&folder.path_of(name)))?;
            sums.insert(name.to_owned(), sha256(bytes));
        }
        if let Some(bytes) = self.calibration {
            disk.write(folder, RIG_CALIBRATION, bytes)
                .map_err(RecordError::at(&folder.path_of(RIG_CALIBRATION)))?;
            sums.insert(RIG_CALIBRATION.to_owned(), sha256(bytes));
        }
        let protocol_sha256 = sums.remove("protocol.json").unwrap_or_default();
        // The only ones of these files that change: they follow from the journal.
        sums.remove("trials.csv");
        sums.remove(tables::RIG_TABLE);
        let file = folder.path_of(super::JOURNAL);
        let mut journal = Journal::create(disk, folder).map_err(RecordError::at(&file))?;
        journal.append(disk, &self.first_record(protocol_sha256, sums)).map_err(RecordError::at(&file))?;
        Ok(journal)
    }

    fn has(&self, folder: &str) -> bool {
        let before = &self.protocol.before;
        match folder {
            "familiarisation" => before.familiarisation_trials > 0,
            tables::RIG_FOLDER => !self.protocol.rig_trials.is_empty(),
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
            recorded_filter: self.signals.recorded_filter,
            channels: self.signals.channels.clone(),
            seed: self.seed,
            program: PROGRAM.to_owned(),
        }
    }

    fn first_record(&self, protocol_sha256: String, files_sha256: BTreeMap<String, String>) -> JournalEntry {
        JournalEntry::Session {
            format: JOURNAL_FORMAT.to_owned(),
            program: PROGRAM.to_owned(),
            seed: self.seed,
            protocol_sha256,
            rules: RULES,
            motion_delay_samples: self.motion_delay_samples,
            files_sha256,
        }
    }
}

fn make(disk: &Disk, parent: &Folder, name: &str) -> Result<Folder, RecordError> {
    disk.create_folder(parent, name).map_err(|error| match error.kind() {
        std::io::ErrorKind::AlreadyExists => RecordError::Exists(parent.path_of(name)),
        _ => RecordError::at(&parent.path_of(name))(error),
    })
}
