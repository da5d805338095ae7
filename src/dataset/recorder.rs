//! Keeps a session while it runs: the journal before anything acts on it, samples as they come, tables whole.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};

use super::disk::Disk;
use super::journal::{Journal, Record};
use super::rows::{HEADER, Rows};
use super::tables;
use crate::rig::Sample;
use crate::session::{
    Detail, Happening, Input, Machine, Output, Phase, Reading, Recorder as KeepsSession, Recording,
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
    rows: Rows,
    open: Option<OpenRecord>,
}

/// A record that is being written.
#[derive(Debug)]
struct OpenRecord {
    recording: Recording,
    /// Path in the session folder that it gets when it is complete.
    file: String,
    handle: File,
    buffer: Vec<u8>,
    samples: u64,
}

impl Recorder {
    /// Keeps the session in `folder`, whose journal has been begun.
    pub fn new(folder: &Path, disk: Disk, journal: Journal, sample_rate_hz: f64) -> Self {
        Self { folder: folder.to_owned(), disk, journal, rows: Rows::new(sample_rate_hz), open: None }
    }

    /// The session's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    fn append(&mut self, record: &Record) -> Result<(), RecordError> {
        self.journal.append(&self.disk, record).map_err(RecordError::at(&self.folder.join(super::JOURNAL)))
    }

    fn begin(&mut self, recording: Recording, machine: &Machine) -> Result<(), RecordError> {
        let Some(file) = record_name(recording, machine) else { return Ok(()) };
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
        if open.buffer.len() >= CHUNK {
            let path = self.folder.join(&open.file);
            self.disk.append(&mut open.handle, &open.buffer).map_err(RecordError::at(&path))?;
            open.buffer.clear();
        }
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

    fn write_tables(&self, machine: &Machine) -> Result<(), RecordError> {
        for (name, bytes) in tables::of_session(machine.ledger(), machine.settings(), &self.rows) {
            let path = self.folder.join(name);
            self.disk.write(&path, &bytes).map_err(RecordError::at(&path))?;
        }
        Ok(())
    }
}

impl KeepsSession for Recorder {
    type Error = RecordError;

    fn take(&mut self, input: &Input, output: &Output, machine: &Machine) -> Result<(), RecordError> {
        let open = self.open.as_ref().map_or(Recording::None, |open| open.recording);
        if open != Recording::None && open != output.recording {
            self.finish()?;
        }
        if let Some(happening) = output.happened {
            self.append(&Record::Happened(happening))?;
        }
        if let Some(word) = output.refused {
            self.append(&Record::Refused { sample: machine.sample(), word })?;
        }
        if output.recording != Recording::None {
            if open != output.recording {
                self.begin(output.recording, machine)?;
            }
            if let Reading::Sample(sample) = &input.reading {
                self.keep(sample)?;
            }
        }
        match output.happened {
            Some(happening) if alters_tables(&happening) => self.write_tables(machine),
            _ => Ok(()),
        }
    }
}

fn alters_tables(happening: &Happening) -> bool {
    let detail = happening.detail.as_ref();
    happening.to != Phase::Hold && detail.is_some_and(|detail| !matches!(detail, Detail::Onset { .. }))
}

/// Where a record goes.
fn record_name(recording: Recording, machine: &Machine) -> Option<String> {
    match recording {
        Recording::None => None,
        Recording::Offset => Some("before/offset.csv".to_owned()),
        Recording::Effort(number) => Some(format!("before/effort-{number}.csv")),
        Recording::Trial => machine.ledger().current().map(tables::trial_file),
    }
}

#[cfg(test)]
mod tests;
