//! The manifest: what a session consists of and what made it, so that every later change shows.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, ErrorKind};
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::amendments::AMENDMENTS;
use super::csv_input::SessionFolder;
use super::description_json::parse_json;
use super::disk::Disk;
use super::error::{DatasetError, FilePlace};
use super::folder::{Description, PROGRAM, pretty, sha256};
use super::journal::JOURNAL;
use super::recorder::RecordError;

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
        let about: Description =
            parse_json(&opened.name("session.json"), &opened.text("session.json", None)?)?;
        let files = stock(folder)?;
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
        if !folder.join(MANIFEST).exists() {
            // Of a folder that is no session, nothing could be brought to its end.
            opened.text("session.json", None)?;
            let expected = if folder.join(JOURNAL).exists() {
                "the manifest that is written when a session ends; ramphold resume brings it to its end"
            } else {
                "the manifest of a session that this program ran; this one was measured elsewhere, so there is nothing to compare \
                 its files with. ramphold trials lists its trials, and ramphold fit checks them"
            };
            return Err(DatasetError::Missing { at: FilePlace::file(name), expected: expected.to_owned() });
        }
        let text = opened.text(MANIFEST, None)?;
        let manifest: Self = parse_json(&name, &text)?;
        if manifest.format != MANIFEST_FORMAT {
            let at = FilePlace::field(name, "format");
            return Err(DatasetError::UnknownFormat {
                at,
                found: manifest.format,
                expected: MANIFEST_FORMAT,
            });
        }
        Ok(manifest)
    }

    /// Writes it into `folder`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        let path = folder.join(MANIFEST);
        disk.write(&path, &pretty(self)).map_err(RecordError::at(&path))
    }

    /// Every file that is not as the manifest says, by name.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn changes(&self, folder: &Path) -> Result<Vec<Change>, DatasetError> {
        let now = stock(folder)?;
        let mut changes: Vec<Change> = self
            .files
            .iter()
            .filter_map(|(file, kept)| match now.get(file) {
                None => Some(Change::Missing(file.clone())),
                Some(found) if found != kept => Some(Change::Changed(file.clone())),
                Some(_) => None,
            })
            .collect();
        let added = now.keys().filter(|file| !self.files.contains_key(*file));
        changes.extend(added.map(|file| Change::Added(file.clone())));
        changes.sort_by(|a, b| a.file().cmp(b.file()));
        Ok(changes)
    }

    /// Takes note of results that were made anew; what was measured stays as it was noted. Without a manifest in
    /// `folder` there is nothing to do.
    ///
    /// # Errors
    /// If the folder cannot be read or written.
    pub fn renew_results(disk: &Disk, folder: &Path) -> Result<(), RecordError> {
        Self::renew(disk, folder, |file| file.starts_with("results/"))
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
        if !path.exists() {
            return Ok(());
        }
        let renewed = || -> Result<Self, DatasetError> {
            let mut manifest = Self::read(folder)?;
            manifest.files.retain(|file, _| !is_renewed(file));
            let results = stock(folder)?.into_iter().filter(|(file, _)| is_renewed(file));
            manifest.files.extend(results);
            Ok(manifest)
        };
        let manifest =
            renewed().map_err(|error| RecordError::at(&path)(io::Error::other(error.to_string())))?;
        manifest.write(disk, folder)
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

/// Every file in a folder but the manifest.
fn stock(folder: &Path) -> Result<BTreeMap<String, ManifestEntry>, DatasetError> {
    let mut files = BTreeMap::new();
    let mut folders = vec![String::new()];
    while let Some(inside) = folders.pop() {
        let path = folder.join(&inside);
        let failed =
            |source| DatasetError::Unreadable { at: FilePlace::file(path.display().to_string()), source };
        for entry in fs::read_dir(&path).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let name = format!("{inside}{}", entry.file_name().to_string_lossy());
            if entry.file_type().map_err(failed)?.is_dir() {
                folders.push(format!("{name}/"));
            } else if name != MANIFEST {
                files.insert(name.clone(), kept(&entry.path(), &name)?);
            }
        }
    }
    Ok(files)
}

fn kept(path: &Path, name: &str) -> Result<ManifestEntry, DatasetError> {
    let bytes = match fs::metadata(path) {
        Ok(about) if about.is_file() => fs::read(path),
        Ok(_) => Err(io::Error::new(ErrorKind::InvalidInput, "not an ordinary file")),
        Err(error) => Err(error),
    };
    let bytes = bytes.map_err(|source| DatasetError::Unreadable { at: FilePlace::file(name), source })?;
    Ok(ManifestEntry { bytes: bytes.len() as u64, sha256: sha256(&bytes) })
}
