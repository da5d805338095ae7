//! Resuming a session after any end: the open record is completed, and the trial under way is aborted.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::journal::{Damage, Interrupted, JOURNAL, Journal};
use super::manifest::{Change, MANIFEST, Manifest};
use super::recorder::{RecordError, Recorder};
use super::recovery::{RecoveredSession, RecoveredState};
use super::trial_csv_writer::HEADER;
use crate::session::{Machine, Phase};

/// Reason why a session cannot be resumed.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// The folder cannot be read, or another program uses it.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The folder cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Files of the session were changed since it ended.
    #[error(
        "{folder}: {} not as the session left it: {}. Put it back from a copy; to go on with the session as it is \
         now, take {MANIFEST} away",
        if .files.len() == 1 { "a file is" } else { "files are" }, .files.join(", ")
    )]
    NotAsItWas {
        /// The session's folder.
        folder: String,
        /// Each file that was changed or is missing.
        files: Vec<String>,
    },
}

/// A session that can be resumed, locked against other programs.
#[derive(Debug)]
pub struct Resumable {
    session: RecoveredSession,
    state: RecoveredState,
    journal: Journal,
    disk: Disk,
    has_manifest: bool,
}

/// A resumed session: disarmed, waiting for the operator's start.
#[derive(Debug)]
pub struct Resumed {
    /// Recorder of the resumed session.
    pub recorder: Recorder,
    /// State machine of the session.
    pub machine: Machine,
    /// Trial that was under way.
    pub interrupted: Option<Interrupted>,
    /// Damaged end of the journal that was cut off.
    pub torn: Option<Damage>,
}

impl Resumable {
    /// Opens and locks the session in `path`. Nothing is changed yet.
    ///
    /// # Errors
    /// If another program is at work in it, its journal is damaged in the middle, or it is no session of this program.
    pub fn open(path: &Path, disk: Disk) -> Result<Self, ResumeError> {
        let at = path.join(JOURNAL);
        let journal = match Journal::open(&disk, path) {
            Ok(journal) => journal,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                return Err(DatasetError::InUse { at: FilePlace::file(path.display().to_string()) }.into());
            }
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                // Reading the folder gives the more precise error.
                RecoveredSession::read(path)?;
                return Err(RecordError::at(&at)(error).into());
            }
            Err(error) => return Err(RecordError::at(&at)(error).into()),
        };
        let session = RecoveredSession::read(path)?;
        session.undamaged()?;
        let has_manifest = path.join(MANIFEST).exists();
        if has_manifest {
            check_unchanged(path)?;
        }
        let mut state = RecoveredState::new(&session.settings);
        for placed in &session.journal.records {
            state.apply(&placed.record);
        }
        Ok(Self { session, state, journal, disk, has_manifest })
    }

    /// Identifier of the subject.
    pub fn subject(&self) -> &str {
        &self.session.subject
    }

    /// Seed of the session.
    pub fn seed(&self) -> u64 {
        self.session.settings.seed
    }

    /// Sample rate, Hz.
    pub fn sample_rate_hz(&self) -> f64 {
        self.session.settings.sample_rate_hz
    }

    /// By how many samples the motor of the session follows a command later than at the next sample.
    pub fn motion_delay_samples(&self) -> u64 {
        self.session.settings.motion_delay_samples
    }

    /// Whether the rig was armed in the session, so that its start position is known to somebody.
    pub fn was_armed(&self) -> bool {
        self.state.was_armed || self.state.origin.is_some()
    }

    /// Whether every trial is done, so that only the results can be missing.
    pub fn is_finished(&self) -> bool {
        self.state.phase == Phase::Finished
    }

    /// Whether every trial is done and the results are complete.
    pub fn is_complete(&self) -> bool {
        self.is_finished() && self.has_manifest
    }

    /// Trials left to do, the one that was under way included.
    pub fn left(&self) -> usize {
        let under_way = self.state.progress.current().is_some_and(|trial| !trial.planned.key.practice);
        self.state.progress.queue().len() + usize::from(under_way)
    }

    /// Completes the open record and notes in the journal that the session was resumed.
    ///
    /// # Errors
    /// If the folder cannot be written. It can be tried again.
    pub fn resume(self) -> Result<Resumed, RecordError> {
        let is_finished = self.is_finished();
        let Self { session, mut state, mut journal, disk, .. } = self;
        let at = session.path.join(JOURNAL);
        // First the manifest, which is invalid once another file has changed.
        remove_unfinished(&disk, &session.path)?;
        if let Some(torn) = &session.journal.torn {
            journal.cut(&disk, torn.offset).map_err(RecordError::at(&at))?;
        }
        let samples = match &state.open {
            Some(file) => complete_record(&disk, &session.path.join(file))?,
            None => 0,
        };
        let interrupted = state
            .progress
            .interrupt(samples)
            .map(|trial| Interrupted { number: trial.number, samples: trial.samples });
        let machine = Machine::with_progress(session.settings.clone(), state.progress.clone());
        let mut recorder = Recorder::new(&session.path, disk, journal, session.settings, state.names);
        if is_finished {
            recorder.write_tables(&state.progress)?;
        } else {
            recorder.resume(interrupted, &state.progress)?;
        }
        Ok(Resumed { recorder, machine, interrupted, torn: session.journal.torn })
    }
}

/// Compares the measured files with the manifest. Results and added files, such as exports, are not compared.
fn check_unchanged(folder: &Path) -> Result<(), ResumeError> {
    let changes = Manifest::read(folder)?.changes(folder)?;
    let files: Vec<String> = changes
        .iter()
        .filter(|change| !matches!(change, Change::Added(_)) && !change.file().starts_with("results/"))
        .map(|change| format!("{} {}", change.file(), change.word()))
        .collect();
    if files.is_empty() {
        return Ok(());
    }
    Err(ResumeError::NotAsItWas { folder: folder.display().to_string(), files })
}

/// Removes unfinished files of [`Disk::write`] and the manifest.
fn remove_unfinished(disk: &Disk, folder: &Path) -> Result<(), RecordError> {
    for folder in [folder.to_owned(), folder.join("results")] {
        let entries = match fs::read_dir(&folder) {
            Ok(entries) => entries,
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            Err(error) => return Err(RecordError::at(&folder)(error)),
        };
        for entry in entries {
            let path = entry.map_err(RecordError::at(&folder))?.path();
            let is_manifest = path.file_name().is_some_and(|name| name == MANIFEST);
            if is_manifest || is_half_written(&path) {
                disk.remove(&path).map_err(RecordError::at(&path))?;
            }
        }
    }
    Ok(())
}

/// `trials.csv.new` and the like.
fn is_half_written(path: &Path) -> bool {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    [".csv.new", ".json.new", ".html.new"].iter().any(|ending| name.ends_with(ending))
}

/// Completes the record that was being written: keeps its complete rows under its final name. Returns their number.
fn complete_record(disk: &Disk, path: &Path) -> Result<u64, RecordError> {
    let part = path.with_added_extension("part");
    let read = |path: &Path| match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    };
    let complete = || -> io::Result<u64> {
        let (bytes, has_name) = match (read(&part)?, read(path)?) {
            (Some(bytes), _) => (bytes, false),
            (None, Some(bytes)) => (bytes, true),
            (None, None) => (Vec::new(), false),
        };
        let (good, samples) = complete_rows(&bytes);
        if !has_name || good.len() != bytes.len() {
            disk.write(path, &good)?;
        }
        if part.exists() {
            disk.remove(&part)?;
        }
        Ok(samples)
    };
    complete().map_err(RecordError::at(path))
}

/// The header and the complete rows of a record, and the number of rows.
fn complete_rows(bytes: &[u8]) -> (Vec<u8>, u64) {
    let mut good = HEADER.to_vec();
    let mut samples = 0;
    if !bytes.starts_with(HEADER) {
        return (good, samples);
    }
    for row in bytes[HEADER.len()..].split_inclusive(|byte| *byte == b'\n') {
        if !is_complete_row(row) {
            break;
        }
        good.extend_from_slice(row);
        samples += 1;
    }
    (good, samples)
}

/// Whether a row ends with a line break and has a finite number in each column.
fn is_complete_row(row: &[u8]) -> bool {
    let Some(text) = row.strip_suffix(b"\n").and_then(|row| std::str::from_utf8(row).ok()) else {
        return false;
    };
    let numbers = text.split(',').map(|cell| cell.parse::<f64>().is_ok_and(f64::is_finite));
    numbers.clone().all(|good| good) && numbers.count() == HEADER.split(|byte| *byte == b',').count()
}

#[cfg(test)]
mod tests;
