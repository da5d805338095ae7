//! Judgements on trials after the session: a file beside the raw data, which stay as they are.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::Trial;
use super::csv_input::SessionFolder;
use super::description_json::{check_format, parse_json};
use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::recorder::RecordError;
use crate::files::{Folder, limits};
use crate::json_file;
use crate::session::Status;

/// Name of the file in a session folder.
pub const AMENDMENTS: &str = "amendments.json";

/// Format and version of the file.
const AMENDMENTS_FORMAT: &str = "ramphold-amendments/1";

/// A judgement on a trial that takes the place of its status in `trials.csv`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Amendment {
    /// Number of the trial.
    pub trial: u32,
    /// SHA-256 of the record that was judged, in hexadecimal digits. `None` for a trial without a record, and of files that do not name it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub record_sha256: Option<String>,
    /// The status from now on.
    pub status: Status,
    /// Why.
    pub because: String,
    /// Who judged.
    pub by: String,
    /// When, in UTC: `2026-11-24T15:00:00Z`.
    pub at_utc: String,
}

/// All judgements on the trials of a session, the oldest first. The last one on a trial counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Amendments {
    format: String,
    /// The judgements.
    pub amendments: Vec<Amendment>,
}

impl Default for Amendments {
    fn default() -> Self {
        Self { format: AMENDMENTS_FORMAT.to_owned(), amendments: Vec::new() }
    }
}

impl Amendments {
    /// Reads those of the session in `folder`; none if there is no file.
    ///
    /// # Errors
    /// If the file is there and is not what it should be.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        Self::of(&SessionFolder::open(folder)?)
    }

    pub(super) fn of(folder: &SessionFolder) -> Result<Self, DatasetError> {
        let text = match folder.text(AMENDMENTS, limits::SETTINGS_BYTES, None) {
            Err(DatasetError::Missing { .. }) => return Ok(Self::default()),
            text => text?,
        };
        let name = folder.name(AMENDMENTS);
        let read: Self = parse_json(&name, &text)?;
        check_format(|| FilePlace::field(name, "format"), &read.format, AMENDMENTS_FORMAT)?;
        Ok(read)
    }

    /// The judgement that counts for a trial.
    pub fn of_trial(&self, number: u32) -> Option<&Amendment> {
        self.amendments.iter().rev().find(|amendment| amendment.trial == number)
    }

    /// Writes them into `folder`.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        let write = || disk.write(&Folder::open(folder)?, AMENDMENTS, json_file::pretty(self).as_bytes());
        write().map_err(RecordError::at(&folder.join(AMENDMENTS)))
    }
}

/// SHA-256 of the record of a trial of the session in `folder`, in hexadecimal digits; `None` if the trial has no record there.
///
/// # Errors
/// If the record cannot be read.
pub fn record_sha256(folder: &Path, trial: &Trial) -> Result<Option<String>, DatasetError> {
    record_sum(&SessionFolder::open(folder)?, trial)
}

pub(super) fn record_sum(folder: &SessionFolder, trial: &Trial) -> Result<Option<String>, DatasetError> {
    let file = trial.file.as_str();
    if file.is_empty() || !folder.folder().contains(file) {
        return Ok(None);
    }
    let (_, sum) = folder.folder().sum(file).map_err(|error| folder.unreadable(file, error))?;
    Ok(Some(sum))
}
