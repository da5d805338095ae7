//! Going on with a session after any end: what was being written is settled, the trial under way counts as aborted.

use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

use super::disk::Disk;
use super::error::{DatasetError, Place};
use super::journal::{Damage, Interrupted, JOURNAL, Journal};
use super::manifest::{Change, MANIFEST, Manifest};
use super::recorder::{RecordError, Recorder};
use super::recovery::{RecoveredSession, RecoveredState};
use super::trial_csv_writer::HEADER;
use crate::session::{Machine, Phase};

/// Why a session cannot be gone on with.
#[derive(Debug, thiserror::Error)]
pub enum ResumeError {
    /// The folder cannot be read, or is at work.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The folder cannot be written.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// Somebody changed the session since it ended.
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

/// A session that nobody else is at work in, and that can be gone on with.
#[derive(Debug)]
pub struct Resumable {
    story: RecoveredSession,
    standing: RecoveredState,
    journal: Journal,
    disk: Disk,
    has_manifest: bool,
}

/// A session at the point where it goes on: disarmed, waiting for the operator's word.
#[derive(Debug)]
pub struct Resumed {
    /// Keeps what happens from here on.
    pub recorder: Recorder,
    /// The session.
    pub machine: Machine,
    /// The trial that was under way.
    pub interrupted: Option<Interrupted>,
    /// The end of the journal that was cut off.
    pub torn: Option<Damage>,
}

impl Resumable {
    /// Opens the session in `path` and keeps others out of it. Nothing is changed yet.
    ///
    /// # Errors
    /// If another program is at work in it, its journal is damaged in the middle, or it is no session of this program.
    pub fn open(path: &Path, disk: Disk) -> Result<Self, ResumeError> {
        let at = path.join(JOURNAL);
        let journal = match Journal::open(&disk, path) {
            Ok(journal) => journal,
            Err(error) if error.kind() == ErrorKind::WouldBlock => {
                return Err(DatasetError::InUse { at: Place::file(path.display().to_string()) }.into());
            }
            Err(error) if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) => {
                // To read the folder tells what is missing in words that fit.
                RecoveredSession::read(path)?;
                return Err(RecordError::at(&at)(error).into());
            }
            Err(error) => return Err(RecordError::at(&at)(error).into()),
        };
        let story = RecoveredSession::read(path)?;
        story.undamaged()?;
        let has_manifest = path.join(MANIFEST).exists();
        if has_manifest {
            check_unchanged(path)?;
        }
        let mut standing = RecoveredState::new(&story.settings);
        for placed in &story.journal.records {
            standing.take(&placed.record);
        }
        Ok(Self { story, standing, journal, disk, has_manifest })
    }

    /// Who is measured.
    pub fn subject(&self) -> &str {
        &self.story.subject
    }

    /// Seed of the session.
    pub fn seed(&self) -> u64 {
        self.story.settings.seed
    }

    /// Samples a second.
    pub fn sample_rate_hz(&self) -> f64 {
        self.story.settings.sample_rate_hz
    }

    /// By how many samples the motor of the session follows a command later than at the next sample.
    pub fn motion_delay_samples(&self) -> u64 {
        self.story.settings.motion_delay_samples
    }

    /// Whether every trial is done, so that only the results can be missing.
    pub fn is_finished(&self) -> bool {
        self.standing.phase == Phase::Finished
    }

    /// Whether it was brought to its end, results and all.
    pub fn is_complete(&self) -> bool {
        self.is_finished() && self.has_manifest
    }

    /// Trials left to do, the one that was under way included.
    pub fn left(&self) -> usize {
        let under_way = self.standing.progress.current().is_some_and(|trial| !trial.planned.key.practice);
        self.standing.progress.queue().len() + usize::from(under_way)
    }

    /// Settles what was being written and notes in the journal that the session goes on.
    ///
    /// # Errors
    /// If the folder cannot be written. It can be tried again.
    pub fn resume(self) -> Result<Resumed, RecordError> {
        let is_finished = self.is_finished();
        let Self { story, mut standing, mut journal, disk, .. } = self;
        let at = story.path.join(JOURNAL);
        // First the manifest, which no longer fits once anything else is another.
        remove_unfinished(&disk, &story.path)?;
        if let Some(torn) = &story.journal.torn {
            journal.cut(&disk, torn.offset).map_err(RecordError::at(&at))?;
        }
        let samples = match &standing.open {
            Some(file) => settle(&disk, &story.path.join(file))?,
            None => 0,
        };
        let interrupted = standing
            .progress
            .interrupt(samples)
            .map(|trial| Interrupted { number: trial.number, samples: trial.samples });
        let machine = Machine::with_progress(story.settings.clone(), standing.progress.clone());
        let mut recorder = Recorder::new(&story.path, disk, journal, story.settings, standing.names);
        if is_finished {
            recorder.write_tables(&standing.progress)?;
        } else {
            recorder.resume(interrupted, &standing.progress)?;
        }
        Ok(Resumed { recorder, machine, interrupted, torn: story.journal.torn })
    }
}

/// Holds what was measured against the manifest. Results can be made anew, and files that were added, such as exports, are
/// no hindrance.
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

/// Takes away what [`Disk::write`] had begun, and the manifest, which no longer fits once the session goes on.
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

/// Gives the record that was being written its name; the number of samples in it.
fn settle(disk: &Disk, path: &Path) -> Result<u64, RecordError> {
    let part = path.with_added_extension("part");
    let read = |path: &Path| match fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    };
    let settle = || -> io::Result<u64> {
        let (bytes, has_name) = match (read(&part)?, read(path)?) {
            (Some(bytes), _) => (bytes, false),
            (None, Some(bytes)) => (bytes, true),
            (None, None) => (Vec::new(), false),
        };
        let (good, samples) = whole_rows(&bytes);
        if !has_name || good.len() != bytes.len() {
            disk.write(path, &good)?;
        }
        if part.exists() {
            disk.remove(&part)?;
        }
        Ok(samples)
    };
    settle().map_err(RecordError::at(path))
}

/// The rows that are whole, with their header, and how many they are.
fn whole_rows(bytes: &[u8]) -> (Vec<u8>, u64) {
    let mut good = HEADER.to_vec();
    let mut samples = 0;
    if !bytes.starts_with(HEADER) {
        return (good, samples);
    }
    for row in bytes[HEADER.len()..].split_inclusive(|byte| *byte == b'\n') {
        if !is_whole(row) {
            break;
        }
        good.extend_from_slice(row);
        samples += 1;
    }
    (good, samples)
}

/// Whether a row ends as it should and has a number in each column. A disk that lost its power may show anything.
fn is_whole(row: &[u8]) -> bool {
    let Some(text) = row.strip_suffix(b"\n").and_then(|row| std::str::from_utf8(row).ok()) else {
        return false;
    };
    let numbers = text.split(',').map(|cell| cell.parse::<f64>().is_ok_and(f64::is_finite));
    numbers.clone().all(|good| good) && numbers.count() == HEADER.split(|byte| *byte == b',').count()
}

#[cfg(test)]
mod tests;
