//! Keeps a session while it runs: the journal before anything acts on it, samples as they come, tables whole.

use std::collections::BTreeMap;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::audit::AuditEntry;
use super::disk::Disk;
use super::journal::{Interrupted, Journal, JournalEntry};
use super::tables;
use super::trial_csv_writer::{HEADER, TrialCsvWriter};
use crate::protocol::TooShort;
use crate::rig::Sample;
use crate::session::{
    Event, Input, Machine, Output, Phase, Progress, Reading, RecordTarget, Recorder as KeepsSession,
    Settings, TransitionDetail, TransitionRecord,
};

/// So many bytes of rows are collected before they are handed to the operating system.
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
    /// What happened so far; the same as the session's own.
    progress: Progress,
    /// How many records were begun under a name.
    begun: RecordNames,
    open: Option<OpenRecord>,
}

/// All that a recorder needs to know of a step.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Steps so far.
    pub sample: u64,
    /// What the rig measured.
    pub measured: Option<Sample>,
    /// To which record it belongs.
    pub recording: RecordTarget,
    /// What happened.
    pub happened: Option<TransitionRecord>,
    /// The operator's word that was not possible.
    pub refused: Option<Event>,
}

impl Step {
    /// What is to be kept of a step.
    pub fn new(input: &Input, output: &Output, machine: &Machine) -> Self {
        let measured = match (&input.reading, output.happened) {
            // A sample that broke a limit may be no number; the journal tells what it was.
            (_, Some(TransitionRecord { event: Event::Fault, .. })) => None,
            (Reading::Sample(sample), _) => Some(*sample),
            _ => None,
        };
        let (recording, happened, refused) = (output.recording, output.happened, output.refused);
        Self { sample: machine.sample(), measured, recording, happened, refused }
    }

    /// Whether there is anything in it to keep.
    pub fn is_kept(&self) -> bool {
        self.recording != RecordTarget::None || self.happened.is_some() || self.refused.is_some()
    }

    /// Whether the journal tells of it.
    pub fn is_told(&self) -> bool {
        self.happened.is_some() || self.refused.is_some()
    }
}

/// A record that is being written.
#[derive(Debug)]
struct OpenRecord {
    recording: RecordTarget,
    /// Path in the session folder that it gets when it is complete.
    file: String,
    handle: File,
    buffer: Vec<u8>,
    samples: u64,
}

impl Recorder {
    /// Keeps the session in `folder`, whose journal has been begun.
    pub(super) fn new(
        folder: &Path,
        disk: Disk,
        journal: Journal,
        settings: Arc<Settings>,
        (progress, begun): (Progress, RecordNames),
    ) -> Self {
        let rows = TrialCsvWriter::new(settings.sample_rate_hz);
        Self { folder: folder.to_owned(), disk, journal, rows, settings, progress, begun, open: None }
    }

    /// The session goes on after the program had ended.
    pub(super) fn resume(&mut self, interrupted: Option<Interrupted>) -> Result<(), RecordError> {
        self.append(&JournalEntry::Resumed { interrupted })?;
        self.write_tables()
    }

    /// The session's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Keeps what was done at a console. When this returns it is on disk.
    pub fn keep_remark(&mut self, remark: AuditEntry) -> Result<(), RecordError> {
        self.append(&JournalEntry::Console(remark))
    }

    fn append(&mut self, record: &JournalEntry) -> Result<(), RecordError> {
        self.journal.append(&self.disk, record).map_err(RecordError::at(&self.folder.join(super::JOURNAL)))
    }

    fn begin(&mut self, recording: RecordTarget) -> Result<(), RecordError> {
        let Some(file) = self.begun.name(recording, &self.progress) else { return Ok(()) };
        let path = self.folder.join(&file).with_added_extension("part");
        let handle = self.disk.create(&path).map_err(RecordError::at(&path))?;
        let mut buffer = Vec::with_capacity(2 * CHUNK);
        buffer.extend_from_slice(HEADER);
        self.open = Some(OpenRecord { recording, file, handle, buffer, samples: 0 });
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

    pub(super) fn write_tables(&self) -> Result<(), RecordError> {
        for (name, bytes) in tables::of_session(&self.progress, &self.settings, &self.rows) {
            let path = self.folder.join(name);
            self.disk.write(&path, &bytes).map_err(RecordError::at(&path))?;
        }
        Ok(())
    }
}

impl Recorder {
    /// Keeps a step. When this returns it is on disk.
    pub fn keep_step(&mut self, step: &Step) -> Result<(), RecordError> {
        if let Some(happening) = &step.happened {
            self.progress.apply(happening);
        }
        let open = self.open.as_ref().map_or(RecordTarget::None, |open| open.recording);
        if open != RecordTarget::None && open != step.recording {
            // The sample that ended a record belongs to it: without it, nobody could tell why it ended.
            if let Some(sample) = &step.measured {
                self.keep(sample)?;
            }
            self.finish()?;
        }
        let goes_on = open != RecordTarget::None && open == step.recording;
        if let (true, Some(sample)) = (goes_on, &step.measured) {
            self.keep(sample)?;
        }
        if step.is_told() {
            // What an entry rests on is in the record before the entry is in the journal.
            self.flush()?;
        }
        if let Some(happening) = step.happened {
            self.append(&JournalEntry::Happened(happening))?;
        }
        if let Some(word) = step.refused {
            self.append(&JournalEntry::Refused { sample: step.sample, word })?;
        }
        if step.recording != RecordTarget::None && !goes_on {
            self.begin(step.recording)?;
            if let Some(sample) = &step.measured {
                self.keep(sample)?;
            }
        }
        match step.happened {
            Some(happening) if alters_tables(&happening) => self.write_tables(),
            _ => Ok(()),
        }
    }
}

impl KeepsSession for Recorder {
    type Error = RecordError;

    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), RecordError> {
        self.keep_step(&Step::new(input, output, machine))
    }
}

/// How often a record was begun under each name. Of a measurement that was broken off there is more than one record, and
/// none is written over.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct RecordNames(BTreeMap<String, u32>);

impl RecordNames {
    /// The name of the next record, if there is to be one.
    pub fn name(&mut self, recording: RecordTarget, progress: &Progress) -> Option<String> {
        let stem = match recording {
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

fn alters_tables(happening: &TransitionRecord) -> bool {
    let detail = happening.detail.as_ref();
    happening.to != Phase::Hold
        && detail.is_some_and(|detail| !matches!(detail, TransitionDetail::Onset { .. }))
}

#[cfg(test)]
pub(super) mod tests;
