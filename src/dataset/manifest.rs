//! The manifest: what a session consists of and what made it, so that every later change shows.

use std::collections::{BTreeMap, BTreeSet};
use std::io;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::amendments::AMENDMENTS;
use super::csv_input::SessionFolder;
use super::description_json::{check_format, parse_json};
use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::folder::{Description, PROGRAM};
use super::journal::JOURNAL;
use super::recorder::RecordError;
use super::rig_calibration::RIG_CALIBRATION;
use crate::files::{EntryKind, Folder, TreeFile, is_unfinished, limits};
use crate::json_file;

/// Name of the manifest in a session folder.
pub const MANIFEST: &str = "manifest.json";

/// Format and version of the manifest.
const MANIFEST_FORMAT: &str = "ramphold-manifest/1";

/// What a session folder holds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    format: String,
    /// The program that wrote it, with its version.
    pub program: String,
    /// The commit that the program was built from, if the build knew it.
    pub git_commit: Option<String>,
    /// Operating system and processor; `any` for a virtual run, which is the same on all of them.
    pub platform: String,
    /// Who was measured.
    pub subject: String,
    /// Seed of the session.
    pub seed: u64,
    /// SHA-256 of `protocol.json`.
    pub protocol_sha256: Option<String>,
    /// SHA-256 of `rig.json`.
    pub rig_sha256: Option<String>,
    /// Every file but this one, by its path with `/`.
    pub files: BTreeMap<String, ManifestEntry>,
}

/// A file as it was.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct ManifestEntry {
    /// Length.
    pub bytes: u64,
    /// SHA-256 in hexadecimal digits.
    pub sha256: String,
}

/// What became of a file since the manifest was written.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Change {
    /// Its content is another.
    Changed(String),
    /// It is gone.
    Missing(String),
    /// It was not there.
    Added(String),
}

impl Manifest {
    /// Takes stock of the session in `folder`, which ran on a virtual rig or on `platform`.
    ///
    /// # Errors
    /// If a file cannot be read, or this is no session that the program ran.
    pub fn take(folder: &Path, is_virtual: bool) -> Result<Self, DatasetError> {
        let opened = SessionFolder::open(folder)?;
        let about: Description = parse_json(
            &opened.name("session.json"),
            &opened.text("session.json", limits::SETTINGS_BYTES, None)?,
        )?;
        let files = stock(&opened, |_| true)?;
        let sum = |file: &str| files.get(file).map(|kept| kept.sha256.clone());
        Ok(Self {
            format: MANIFEST_FORMAT.to_owned(),
            program: PROGRAM.to_owned(),
            git_commit: option_env!("RAMPHOLD_COMMIT").map(str::to_owned),
            platform: if is_virtual {
                "any".to_owned()
            } else {
                format!("{}-{}", std::env::consts::OS, std::env::consts::ARCH)
            },
            subject: about.subject.id,
            seed: about.seed,
            protocol_sha256: sum("protocol.json"),
            rig_sha256: sum("rig.json"),
            files,
        })
    }

    /// Reads the manifest of the session in `folder`.
    ///
    /// # Errors
    /// If there is none, or it is none of ours.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        let opened = SessionFolder::open(folder)?;
        let name = opened.name(MANIFEST);
        if !opened.folder().contains(MANIFEST) {
            // Of a folder that is no session, nothing could be brought to its end.
            opened.text("session.json", limits::SETTINGS_BYTES, None)?;
            let expected = if opened.folder().contains(JOURNAL) {
                "the manifest that is written when a session ends; ramphold resume brings it to its end"
            } else {
                "the manifest of a session that this program ran; this one was measured elsewhere, so there is nothing to compare \
                 its files with. ramphold trials lists its trials, and ramphold fit checks them"
            };
            return Err(DatasetError::Missing { at: FilePlace::file(name), expected: expected.to_owned() });
        }
        let text = opened.text(MANIFEST, limits::MANIFEST_BYTES, None)?;
        let manifest: Self = parse_json(&name, &text)?;
        check_format(|| FilePlace::field(name, "format"), &manifest.format, MANIFEST_FORMAT)?;
        Ok(manifest)
    }

    /// Writes it into `folder`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        let write = || disk.write(&Folder::open(folder)?, MANIFEST, json_file::pretty(self).as_bytes());
        write().map_err(RecordError::at(&folder.join(MANIFEST)))
    }

    /// Every file that is not as the manifest says, by name. A file is read only if its length is the one noted; a link, a
    /// FIFO or a device is not what was noted, whatever it leads to.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn changes(&self, folder: &Path) -> Result<Vec<Change>, DatasetError> {
        let opened = SessionFolder::open(folder)?;
        let mut changes = Vec::new();
        let mut found = BTreeSet::new();
        for (name, file) in files(&opened)? {
            match self.files.get(&name) {
                None => changes.push(Change::Added(name)),
                Some(noted) => {
                    if !is_as_noted(&opened, &file, noted)
                        .map_err(|source| opened.unreadable(&name, source))?
                    {
                        changes.push(Change::Changed(name.clone()));
                    }
                    found.insert(name);
                }
            }
        }
        let missing = self.files.keys().filter(|file| !found.contains(*file));
        changes.extend(missing.map(|file| Change::Missing(file.clone())));
        changes.sort_by(|a, b| a.file().cmp(b.file()));
        Ok(changes)
    }

    /// Takes note of results that were made anew; what was measured stays as it was noted. Without a manifest in
    /// `folder` there is nothing to do.
    ///
    /// # Errors
    /// If the folder cannot be read or written.
    pub fn renew_results(disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        Self::renew(disk, folder, |file| file.starts_with("results/") || file == RIG_CALIBRATION)
    }

    /// Takes note of recordings of other devices that were put beside the raw data, in the folder `attached`.
    ///
    /// # Errors
    /// As [`Manifest::renew_results`].
    pub fn renew_attachments(disk: &Disk, folder: &Path, attached: &str) -> Result<(), RecordError> {
        Self::renew(disk, folder, |file| {
            file.strip_prefix(attached).is_some_and(|rest| rest.starts_with('/'))
        })
    }

    /// Takes note of judgements on trials that the operator gave; see [`Amendments`](super::Amendments).
    ///
    /// # Errors
    /// As [`Manifest::renew_results`].
    pub fn renew_amendments(disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        Self::renew(disk, folder, |file| file == AMENDMENTS)
    }

    fn renew(disk: &Disk, folder: &Path, is_renewed: impl Fn(&str) -> bool) -> Result<(), RecordError> {
        let path = folder.join(MANIFEST);
        let renewed = || -> Result<Option<Self>, DatasetError> {
            let opened = SessionFolder::open(folder)?;
            if !opened.folder().contains(MANIFEST) {
                return Ok(None);
            }
            let mut manifest = Self::read(folder)?;
            manifest.files.retain(|file, _| !is_renewed(file));
            manifest.files.extend(stock(&opened, &is_renewed)?);
            Ok(Some(manifest))
        };
        match renewed().map_err(|error| RecordError::at(&path)(io::Error::other(error.to_string())))? {
            Some(manifest) => manifest.write(disk, folder),
            None => Ok(()),
        }
    }
}

impl Change {
    /// Path of the file in the folder.
    pub fn file(&self) -> &str {
        match self {
            Self::Changed(file) | Self::Missing(file) | Self::Added(file) => file,
        }
    }

    /// `changed`, `missing` or `added`.
    pub fn word(&self) -> &'static str {
        match self {
            Self::Changed(_) => "changed",
            Self::Missing(_) => "missing",
            Self::Added(_) => "added",
        }
    }
}

/// Everything in a folder but the manifest, by its path with `/`.
fn files(folder: &SessionFolder) -> Result<Vec<(String, TreeFile)>, DatasetError> {
    let tree = folder.folder().tree().map_err(|source| folder.unreadable("", source))?;
    let named = tree.into_iter().map(|file| (name_of(&file), file));
    Ok(named.filter(|(name, _)| name != MANIFEST).collect())
}

fn name_of(file: &TreeFile) -> String {
    let parts: Vec<_> = file.path.iter().map(|part| part.to_string_lossy()).collect();
    parts.join("/")
}

/// Length and sum of the plain files in a folder whose name is wanted. A link is no part of a session; `verify` says that it was
/// added. A file that another program has not finished is none yet, and has another name when it is.
fn stock(
    folder: &SessionFolder,
    is_wanted: impl Fn(&str) -> bool,
) -> Result<BTreeMap<String, ManifestEntry>, DatasetError> {
    let wanted = files(folder)?.into_iter().filter(|(name, file)| {
        let is_being_written = file.path.iter().next_back().is_some_and(is_unfinished);
        file.kind == EntryKind::File && !is_being_written && is_wanted(name)
    });
    wanted
        .map(|(name, file)| {
            let (bytes, sha256) =
                folder.folder().sum(&file.path).map_err(|source| folder.unreadable(&name, source))?;
            Ok((name, ManifestEntry { bytes, sha256 }))
        })
        .collect()
}

fn is_as_noted(folder: &SessionFolder, file: &TreeFile, noted: &ManifestEntry) -> io::Result<bool> {
    if file.kind != EntryKind::File || folder.folder().length(&file.path)? != noted.bytes {
        return Ok(false);
    }
    let (bytes, sha256) = folder.folder().sum(&file.path)?;
    Ok(bytes == noted.bytes && sha256 == noted.sha256)
}
