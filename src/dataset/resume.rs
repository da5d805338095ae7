//! Resuming a session after any end: the open record is completed, and the trial under way is aborted.

mod as_left;

use std::collections::BTreeMap;
use std::io::{self, ErrorKind};
use std::path::Path;

use self::as_left::{edited_tables, unmentioned_records};
use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::hexadecimal::sha256;
use super::journal::{Damage, Interrupted, JOURNAL, Journal, RecordSum};
use super::manifest::{Change, MANIFEST, Manifest};
use super::recorder::{RecordError, Recorder, part_of};
use super::recovery::{RecoveredSession, RecoveredState};
use super::tables::header_of_file;
use super::trial_csv_writer::header_of;
use crate::files::{EntryKind, Folder, is_refusal, limits};
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
        "{folder}: {} not as the session left it: {}. Put {} back from a copy; what was measured before cannot be gone on \
         with otherwise. The trials in trials.csv can still be fitted{}",
        if .files.len() == 1 { "a file is" } else { "files are" },
        .files.join(", "),
        if .files.len() == 1 { "it" } else { "them" },
        if .files.iter().any(|file| file.starts_with("trials.csv ")) { JUDGE } else { "" }
    )]
    NotAsItWas {
        /// The session's folder.
        folder: String,
        /// Each file that was changed or is missing.
        files: Vec<String>,
    },
}

/// How a trial is judged without a change of its table.
const JUDGE: &str =
    ". To judge a trial, leave trials.csv as it is and use ramphold trials --reject or --accept";

/// A session that can be resumed, locked against other programs.
#[derive(Debug)]
pub struct Resumable {
    session: RecoveredSession,
    state: RecoveredState,
    journal: Journal,
    disk: Disk,
    has_manifest: bool,
    /// Sums that the journal is still to get.
    missing_sums: BTreeMap<String, String>,
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

/// Whether the journal of the session in `path` says that every trial is done. The session is not locked.
///
/// # Errors
/// If it has no journal that can be read.
pub fn every_trial_is_done(path: &Path) -> Result<bool, DatasetError> {
    Ok(RecoveredSession::read(path)?.state()?.phase == Phase::Finished)
}

impl Resumable {
    /// Opens and locks the session in `path`. Nothing is changed yet.
    ///
    /// # Errors
    /// If another program is at work in it, its journal is damaged in the middle, or it is no session of this program.
    pub fn open(path: &Path, disk: Disk) -> Result<Self, ResumeError> {
        let at = path.join(JOURNAL);
        let journal = match Folder::open(path).and_then(|folder| Journal::open(&disk, &folder)) {
            Ok(journal) => journal,
            Err(source) if is_refusal(&source) => {
                return Err(DatasetError::Unreadable {
                    at: FilePlace::file(at.display().to_string()),
                    source,
                }
                .into());
            }
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
        let has_manifest = session.folder.folder().contains(MANIFEST);
        let state = session.state()?;
        let mut changed = session.changed_files()?;
        changed.extend(edited_tables(&session, &state)?);
        if has_manifest {
            changed.extend(changed_since_the_end(path)?);
        }
        if !changed.is_empty() {
            changed.sort();
            changed.dedup();
            return Err(ResumeError::NotAsItWas { folder: path.display().to_string(), files: changed });
        }
        // A session that is done writes no further record.
        if state.phase != Phase::Finished {
            let files = unmentioned_records(&session, &state.begun)?;
            if !files.is_empty() {
                return Err(
                    DatasetError::NotInTheJournal { folder: path.display().to_string(), files }.into()
                );
            }
        }
        let missing_sums = if session.has_sums() { BTreeMap::new() } else { session.present_sums()? };
        Ok(Self { session, state, journal, disk, has_manifest, missing_sums })
    }

    /// Whether the journal, written by an older version of the program, has no sums: whether its files are those that the
    /// session was begun with cannot be told then.
    pub fn lacks_sums(&self) -> bool {
        !self.missing_sums.is_empty()
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

    /// Whether rig trials are due: the subject was not seated yet.
    pub fn rig_trials_due(&self) -> bool {
        self.state.progress.rig_trials_due()
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
        let Self { session, mut state, mut journal, disk, missing_sums, .. } = self;
        let folder = session.folder.folder().clone();
        let at = folder.path_of(JOURNAL);
        // First the manifest, which is invalid once another file has changed.
        remove_unfinished(&disk, &folder)?;
        if let Some(torn) = &session.journal.torn {
            journal.cut(&disk, torn.offset).map_err(RecordError::at(&at))?;
        }
        let (samples, completed) = match &state.open {
            Some(file) => {
                let (samples, sum) = complete_record(&disk, &folder, file)?;
                (samples, Some(sum))
            }
            None => (0, None),
        };
        let is_rig_trial = state.progress.rig_trials_due();
        let interrupted =
            state.progress.interrupt(samples).map(|number| Interrupted { number, samples, is_rig_trial });
        let machine = Machine::with_progress(session.settings.clone(), state.progress.clone());
        let mut recorder = Recorder::new(folder, disk, journal, session.settings, state.names);
        if is_finished {
            recorder.write_tables(&state.progress)?;
        } else {
            recorder.resume(completed, interrupted, missing_sums, &state.progress)?;
        }
        Ok(Resumed { recorder, machine, interrupted, torn: session.journal.torn })
    }
}

/// The measured files that are not as the manifest has them. Results and added files, such as exports, are not compared.
fn changed_since_the_end(folder: &Path) -> Result<impl Iterator<Item = String>, ResumeError> {
    let changes = Manifest::read(folder)?.changes(folder)?;
    let is_measured =
        |change: &Change| !matches!(change, Change::Added(_)) && !change.file().starts_with("results/");
    let changes = changes.into_iter().filter(is_measured);
    Ok(changes.map(|change| format!("{} {}", change.file(), change.word())))
}

/// Removes unfinished files and the manifest.
fn remove_unfinished(disk: &Disk, folder: &Folder) -> Result<(), RecordError> {
    let mut places: Vec<String> = ["", "results", "results/figures"].map(str::to_owned).into();
    if let Ok(entries) = folder.folder("results").and_then(|results| results.entries()) {
        let inside = entries.into_iter().filter(|entry| entry.kind == EntryKind::Folder);
        for name in inside.filter_map(|entry| entry.name.into_string().ok()).filter(|name| name != "figures")
        {
            places.push(format!("results/{name}"));
            places.push(format!("results/{name}/figures"));
        }
    }
    for inside in &places {
        let remove = || -> io::Result<()> {
            let inside = match folder.folder(inside) {
                Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
                opened => opened?,
            };
            if inside.contains(MANIFEST) {
                disk.remove(&inside, MANIFEST)?;
            }
            inside.unfinished_files()?.into_iter().try_for_each(|name| disk.remove(&inside, name))
        };
        remove().map_err(RecordError::at(&folder.path_of(inside)))?;
    }
    Ok(())
}

/// Completes the record that was being written: keeps its complete rows under its final name. Returns their number, and the
/// sum of the record.
fn complete_record(disk: &Disk, folder: &Folder, file: &str) -> Result<(u64, RecordSum), RecordError> {
    let part = part_of(file);
    let complete = || -> io::Result<(u64, RecordSum)> {
        let read = |name: &str| folder.read_if_there(name, limits::RECORD_BYTES);
        let (bytes, has_name) = match (read(&part)?, read(file)?) {
            (Some(bytes), _) => (bytes, false),
            (None, Some(bytes)) => (bytes, true),
            (None, None) => (Vec::new(), false),
        };
        let (good, samples) = complete_rows(&bytes, header_of_file(file));
        if !has_name || good.len() != bytes.len() {
            disk.write(folder, file, &good)?;
        }
        if folder.contains(&part) {
            disk.remove(folder, &part)?;
        }
        let (bytes, sha256) = (good.len() as u64, sha256(&good));
        Ok((samples, RecordSum { file: file.to_owned(), bytes, sha256 }))
    };
    complete().map_err(RecordError::at(&folder.path_of(file)))
}

/// The header and the complete rows of a record, and the number of rows; of one without a header, `least` and no rows.
fn complete_rows(bytes: &[u8], least: &[u8]) -> (Vec<u8>, u64) {
    let mut samples = 0;
    let Some(header) = header_of(bytes) else { return (least.to_vec(), samples) };
    let columns = header.split(|byte| *byte == b',').count();
    let mut good = header.to_vec();
    for row in bytes[header.len()..].split_inclusive(|byte| *byte == b'\n') {
        if !is_complete_row(row, columns) {
            break;
        }
        good.extend_from_slice(row);
        samples += 1;
    }
    (good, samples)
}

/// Whether a row ends with a line break and has a finite number in each column.
fn is_complete_row(row: &[u8], columns: usize) -> bool {
    let Some(text) = row.strip_suffix(b"\n").and_then(|row| std::str::from_utf8(row).ok()) else {
        return false;
    };
    let numbers = text.split(',').map(|cell| cell.parse::<f64>().is_ok_and(f64::is_finite));
    numbers.clone().all(|good| good) && numbers.count() == columns
}

#[cfg(test)]
pub(super) mod tests;
