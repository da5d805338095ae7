//! Keeps a session while it runs: the journal before anything acts on it, samples as they come, tables whole.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use sha2::{Digest, Sha256};

use super::audit::AuditEntry;
use super::disk::Disk;
use super::hexadecimal::hexadecimal;
use super::journal::{Interrupted, Journal, JournalEntry, RecordSum};
use super::record_splitter::RecordSplitter;
use super::tables;
use super::trial_csv_writer::{TrialCsvWriter, header, rig_header};
use crate::files::{Folder, is_refusal};
use crate::protocol::TooShort;
use crate::rig::{Origin, Sample};
use crate::session::{
    Progress, RecordTarget, Settings, Step, StepConsumer, TransitionDetail, TransitionRecord,
};

/// Bytes of rows that are collected before they are written.
const CHUNK: usize = 16 * 1024;

/// Why a session could not be kept.
#[derive(Debug, thiserror::Error)]
pub enum RecordError {
    /// The folder is there already.
    #[error("{}: is there already; a session never overwrites anything. Choose another folder with --out", .0.display())]
    Exists(PathBuf),
    /// The operating system refuses.
    #[error("{}: cannot be written ({source}). {advice}", .path.display())]
    Unwritable {
        /// What was to be written.
        path: PathBuf,
        /// The operating system's reason.
        source: io::Error,
        /// What to do.
        advice: &'static str,
    },
    /// A velocity that the protocol's amplitude does not suffice for.
    #[error(transparent)]
    TooShort(#[from] TooShort),
    /// The thread that writes has ended.
    #[error("the writer of the session has stopped; what it wrote is safe. Resume the session")]
    WriterGone,
    /// The disk is so slow that the samples waiting for it fill the memory set aside for them.
    #[error(
        "the disk is too slow: {waiting} samples wait to be written. Choose another disk; the session can be resumed"
    )]
    TooSlow {
        /// How many wait.
        waiting: usize,
    },
}

impl RecordError {
    /// An error of the operating system at `path`.
    pub fn at(path: &Path) -> impl FnOnce(io::Error) -> Self {
        move |source| {
            let advice = match source.kind() {
                io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => {
                    "Make room on the disk; a session that was under way can then be resumed"
                }
                io::ErrorKind::PermissionDenied | io::ErrorKind::ReadOnlyFilesystem => {
                    "Choose a folder that you may write to with --out"
                }
                io::ErrorKind::NotFound => "Make the folder above it first",
                _ if is_refusal(&source) => "Nothing was written to it",
                _ => "Check the disk; a session that was under way can be resumed",
            };
            Self::Unwritable { path: path.to_owned(), source, advice }
        }
    }
}

/// The folder of a session that is running.
#[derive(Debug)]
pub struct Recorder {
    folder: Folder,
    disk: Disk,
    journal: Journal,
    rows: TrialCsvWriter,
    settings: Arc<Settings>,
    names: RecordNames,
    splitter: RecordSplitter,
    open: Option<OpenRecord>,
}

/// A record that is being written.
#[derive(Debug)]
struct OpenRecord {
    /// Path in the session folder that it gets when it is complete.
    file: String,
    /// Whether the record has the columns of a rig trial.
    is_rig_trial: bool,
    handle: File,
    buffer: Vec<u8>,
    samples: u64,
    /// Length and sum of what the operating system has.
    bytes: u64,
    sum: Sha256,
}

impl OpenRecord {
    /// Hands the rows so far to the operating system: the death of the program does not take them any more.
    fn flush(&mut self, disk: &Disk) -> io::Result<()> {
        if self.buffer.is_empty() {
            return Ok(());
        }
        disk.append(&mut self.handle, &self.buffer)?;
        self.bytes += self.buffer.len() as u64;
        self.sum.update(&self.buffer);
        self.buffer.clear();
        Ok(())
    }
}

impl Recorder {
    /// Records into `folder`, whose journal has been begun.
    pub(super) fn new(
        folder: Folder,
        disk: Disk,
        journal: Journal,
        settings: Arc<Settings>,
        names: RecordNames,
    ) -> Self {
        let rows = TrialCsvWriter::new(settings.sample_rate_hz);
        Self { folder, disk, journal, rows, settings, names, splitter: RecordSplitter::new(), open: None }
    }

    /// Notes in the journal that the session was resumed.
    pub(super) fn resume(
        &mut self,
        completed: Option<RecordSum>,
        interrupted: Option<Interrupted>,
        files_sha256: BTreeMap<String, String>,
        progress: &Progress,
    ) -> Result<(), RecordError> {
        if let Some(completed) = completed {
            self.append(&JournalEntry::Recorded(completed))?;
        }
        self.append(&JournalEntry::Resumed { interrupted, files_sha256 })?;
        self.write_tables(progress)
    }

    /// The session's folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// Writes an operator's action into the journal. It is on disk when this returns, unless the disk is synchronised at the end.
    pub fn record_action(&mut self, action: AuditEntry) -> Result<(), RecordError> {
        self.append(&JournalEntry::Console(action))
    }

    fn append(&mut self, record: &JournalEntry) -> Result<(), RecordError> {
        self.journal.append(&self.disk, record).map_err(RecordError::at(&self.folder.path_of(super::JOURNAL)))
    }

    fn begin(&mut self, target: RecordTarget, progress: &Progress) -> Result<(), RecordError> {
        let Some(file) = self.names.next(target, progress) else { return Ok(()) };
        // Giving the record its name would take what has it.
        if self.folder.contains(&file) {
            return Err(RecordError::Exists(self.folder.path_of(&file)));
        }
        let part = part_of(&file);
        let handle =
            self.disk.create(&self.folder, &part).map_err(RecordError::at(&self.folder.path_of(&part)))?;
        let is_rig_trial = target == RecordTarget::RigTrial;
        let buffer = Vec::with_capacity(2 * CHUNK);
        self.open =
            Some(OpenRecord { is_rig_trial, file, handle, buffer, samples: 0, bytes: 0, sum: Sha256::new() });
        Ok(())
    }

    fn keep(&mut self, sample: &Sample, target_rad: f64) -> Result<(), RecordError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        // The first sample of a trial shows which columns the record has.
        if open.samples == 0 {
            let header = if open.is_rig_trial { rig_header(sample) } else { header(sample) };
            open.buffer.extend_from_slice(&header);
        }
        if open.is_rig_trial {
            self.rows.push_rig(&mut open.buffer, open.samples, target_rad, sample);
        } else {
            self.rows.push(&mut open.buffer, open.samples, sample);
        }
        open.samples += 1;
        if open.buffer.len() >= CHUNK { self.flush() } else { Ok(()) }
    }

    fn flush(&mut self) -> Result<(), RecordError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        open.flush(&self.disk).map_err(RecordError::at(&self.folder.path_of(&open.file)))
    }

    /// The record is complete. It gets its name only once it is safe, and the journal its sum.
    fn finish(&mut self) -> Result<(), RecordError> {
        let Some(mut open) = self.open.take() else { return Ok(()) };
        if open.samples == 0 {
            open.buffer.extend_from_slice(tables::header_of_file(&open.file));
        }
        let mut write = || {
            open.flush(&self.disk)?;
            self.disk.sync(&open.handle)?;
            self.disk.rename(&self.folder, &part_of(&open.file), &open.file)
        };
        write().map_err(RecordError::at(&self.folder.path_of(&open.file)))?;
        let OpenRecord { file, bytes, sum, .. } = open;
        self.append(&JournalEntry::Recorded(RecordSum { file, bytes, sha256: hexadecimal(sum) }))
    }

    /// Returns when the whole session is on the disk, at the end of it. Only a disk that is synchronised at the end has anything to do.
    ///
    /// # Errors
    /// If the disk fails.
    pub fn settle(&self) -> Result<(), RecordError> {
        self.disk.settle(&self.folder).map_err(RecordError::at(self.folder.path()))
    }

    pub(super) fn write_tables(&self, progress: &Progress) -> Result<(), RecordError> {
        for (name, bytes) in tables::of_session(progress, &self.settings, &self.rows) {
            let path = self.folder.path_of(name);
            self.disk.write(&self.folder, name, &bytes).map_err(RecordError::at(&path))?;
        }
        Ok(())
    }
}

impl StepConsumer for Recorder {
    type Error = RecordError;

    /// Writes into the journal how the rig knew its start position. It is on disk when this returns, as with every step.
    fn note_origin(&mut self, origin: Origin, sample: u64) -> Result<(), RecordError> {
        self.append(&JournalEntry::Origin { sample, origin })
    }

    /// Records a step. It is on disk when this returns, unless the disk is synchronised at the end.
    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), RecordError> {
        if let Some(stamp) = step.clock {
            self.append(&JournalEntry::Clock { sample: step.sample, stamp })?;
        }
        let split = self.splitter.split(step.record);
        if let Some(sample) = &step.measured {
            self.keep(sample, step.target_rad)?;
        }
        if split.ends {
            self.finish()?;
        }
        if step.is_journaled() {
            // The samples that an entry rests on are written before the entry.
            self.flush()?;
        }
        if let Some(transition) = step.transition {
            self.append(&JournalEntry::Transition(transition))?;
        }
        if let Some(command) = step.refused {
            self.append(&JournalEntry::Refused { sample: step.sample, command })?;
        }
        if let Some(target) = split.begins {
            self.begin(target, progress)?;
            if let Some(sample) = &step.measured {
                self.keep(sample, step.target_rad)?;
            }
        }
        match step.transition {
            Some(transition) if changes_tables(&transition) => self.write_tables(progress),
            _ => Ok(()),
        }
    }
}

/// File names of the session's records. A measurement that was broken off and repeated has several records; each gets a
/// name of its own, so that none is overwritten.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct RecordNames(BTreeMap<String, u32>);

impl RecordNames {
    /// The file name of the next record; `None` if the samples belong to no record.
    pub fn next(&mut self, target: RecordTarget, progress: &Progress) -> Option<String> {
        let stem = match target {
            RecordTarget::None => return None,
            RecordTarget::Offset => "before/offset".to_owned(),
            RecordTarget::Effort(number) => format!("before/effort-{number}"),
            RecordTarget::Trial => return progress.current().map(tables::trial_file),
            RecordTarget::RigTrial => {
                return progress.current_rig_trial().map(|attempt| tables::rig_trial_file(attempt.number));
            }
        };
        let times = self.0.entry(stem.clone()).or_default();
        *times += 1;
        Some(if *times == 1 { format!("{stem}.csv") } else { format!("{stem}-again-{}.csv", *times - 1) })
    }
}

/// Name of a record that is not complete.
pub(super) fn part_of(file: &str) -> String {
    format!("{file}.part")
}

fn changes_tables(transition: &TransitionRecord) -> bool {
    let detail = transition.detail.as_ref();
    detail.is_some_and(|detail| {
        !matches!(detail, TransitionDetail::Began { .. } | TransitionDetail::Onset { .. })
    })
}

#[cfg(test)]
pub(super) mod tests;
