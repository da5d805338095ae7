//! Keeps a session while it runs: the journal before anything acts on it, samples as they come, tables whole.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::audit::AuditEntry;
use super::disk::Disk;
use super::journal::{Interrupted, Journal, JournalEntry};
use super::record_splitter::RecordSplitter;
use super::tables;
use super::trial_csv_writer::{HEADER, TrialCsvWriter};
use crate::protocol::TooShort;
use crate::rig::{Origin, Sample};
use crate::session::{
    Phase, Progress, RecordTarget, Settings, Step, StepConsumer, TransitionDetail, TransitionRecord,
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
                _ => "Check the disk; a session that was under way can be resumed",
            };
            Self::Unwritable { path: path.to_owned(), source, advice }
        }
    }
}

/// The folder of a session that is running.
#[derive(Debug)]
pub struct Recorder {
    folder: PathBuf,
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
    handle: File,
    buffer: Vec<u8>,
    samples: u64,
}

impl Recorder {
    /// Records into `folder`, whose journal has been begun.
    pub(super) fn new(
        folder: &Path,
        disk: Disk,
        journal: Journal,
        settings: Arc<Settings>,
        names: RecordNames,
    ) -> Self {
        let rows = TrialCsvWriter::new(settings.sample_rate_hz);
        Self {
            folder: folder.to_owned(),
            disk,
            journal,
            rows,
            settings,
            names,
            splitter: RecordSplitter::new(),
            open: None,
        }
    }

    /// Notes in the journal that the session was resumed.
    pub(super) fn resume(
        &mut self,
        interrupted: Option<Interrupted>,
        progress: &Progress,
    ) -> Result<(), RecordError> {
        self.append(&JournalEntry::Resumed { interrupted })?;
        self.write_tables(progress)
    }

    /// The session's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Writes an operator's action into the journal. It is on disk when this returns.
    pub fn record_action(&mut self, action: AuditEntry) -> Result<(), RecordError> {
        self.append(&JournalEntry::Console(action))
    }

    fn append(&mut self, record: &JournalEntry) -> Result<(), RecordError> {
        self.journal.append(&self.disk, record).map_err(RecordError::at(&self.folder.join(super::JOURNAL)))
    }

    fn begin(&mut self, target: RecordTarget, progress: &Progress) -> Result<(), RecordError> {
        let Some(file) = self.names.next(target, progress) else { return Ok(()) };
        let path = self.folder.join(&file).with_added_extension("part");
        let handle = self.disk.create(&path).map_err(RecordError::at(&path))?;
        let mut buffer = Vec::with_capacity(2 * CHUNK);
        buffer.extend_from_slice(HEADER);
        self.open = Some(OpenRecord { file, handle, buffer, samples: 0 });
        Ok(())
    }

    fn keep(&mut self, sample: &Sample) -> Result<(), RecordError> {
        let Some(open) = &mut self.open else { return Ok(()) };
        self.rows.push(&mut open.buffer, open.samples, sample);
        open.samples += 1;
        if open.buffer.len() >= CHUNK { self.flush() } else { Ok(()) }
    }

    /// Hands the rows so far to the operating system: the death of the program does not take them any more.
    fn flush(&mut self) -> Result<(), RecordError> {
        let Some(open) = self.open.as_mut().filter(|open| !open.buffer.is_empty()) else { return Ok(()) };
        let path = self.folder.join(&open.file);
        self.disk.append(&mut open.handle, &open.buffer).map_err(RecordError::at(&path))?;
        open.buffer.clear();
        Ok(())
    }

    /// The record is complete, and gets its name only once it is safe.
    fn finish(&mut self) -> Result<(), RecordError> {
        let Some(mut open) = self.open.take() else { return Ok(()) };
        let path = self.folder.join(&open.file);
        let part = path.with_added_extension("part");
        let mut write = || {
            self.disk.append(&mut open.handle, &open.buffer)?;
            self.disk.sync(&open.handle)?;
            self.disk.rename(&part, &path)
        };
        write().map_err(RecordError::at(&path))
    }

    pub(super) fn write_tables(&self, progress: &Progress) -> Result<(), RecordError> {
        for (name, bytes) in tables::of_session(progress, &self.settings, &self.rows) {
            let path = self.folder.join(name);
            self.disk.write(&path, &bytes).map_err(RecordError::at(&path))?;
        }
        Ok(())
    }
}

impl StepConsumer for Recorder {
    type Error = RecordError;

    /// Writes into the journal how the rig knew its start position. It is on disk when this returns.
    fn note_origin(&mut self, origin: Origin, sample: u64) -> Result<(), RecordError> {
        self.append(&JournalEntry::Origin { sample, origin })
    }

    /// Records a step. It is on disk when this returns.
    fn consume(&mut self, step: &Step, progress: &Progress) -> Result<(), RecordError> {
        let split = self.splitter.split(step.record);
        if let Some(sample) = &step.measured {
            self.keep(sample)?;
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
                self.keep(sample)?;
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
        };
        let times = self.0.entry(stem.clone()).or_default();
        *times += 1;
        Some(if *times == 1 { format!("{stem}.csv") } else { format!("{stem}-again-{}.csv", *times - 1) })
    }
}

fn changes_tables(transition: &TransitionRecord) -> bool {
    let detail = transition.detail.as_ref();
    transition.to != Phase::Hold
        && detail.is_some_and(|detail| !matches!(detail, TransitionDetail::Onset { .. }))
}

#[cfg(test)]
pub(super) mod tests;
