//! Takes the place of `open_at` where the operating system has no `openat`: every part of a path is looked at before it is
//! opened. A program that exchanges a part between the two can still lead it astray.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, FileType, OpenOptions};
use std::io;
use std::path::{Path, PathBuf};

use super::entry_kind::EntryKind;
use super::purpose::Purpose;
use super::refusal::FileRefusal;

/// The path of a folder.
#[derive(Debug)]
pub(super) struct FolderHandle(PathBuf);

impl FolderHandle {
    /// The folder that the operator named; links in its path are followed.
    pub fn given(path: &Path) -> io::Result<Self> {
        let path = fs::canonicalize(path)?;
        kind_of(path.metadata()?.file_type()).check_folder()?;
        Ok(Self(path))
    }

    /// A folder in it.
    pub fn folder(&self, name: &OsStr) -> io::Result<Self> {
        self.kind(name)?.check_folder()?;
        Ok(Self(self.0.join(name)))
    }

    /// Opens a plain file in it.
    pub fn file(&self, name: &OsStr, purpose: Purpose) -> io::Result<File> {
        let path = self.0.join(name);
        match purpose {
            Purpose::CreateNew => return OpenOptions::new().append(true).create_new(true).open(path),
            Purpose::Read | Purpose::Append => self.kind(name)?.check_file()?,
        }
        match purpose {
            Purpose::Read => File::open(path),
            Purpose::Append | Purpose::CreateNew => OpenOptions::new().append(true).open(path),
        }
    }

    /// What a name in it stands for.
    pub fn kind(&self, name: &OsStr) -> io::Result<EntryKind> {
        Ok(kind_of(fs::symlink_metadata(self.0.join(name))?.file_type()))
    }

    /// Makes a folder, which must not be there.
    pub fn make_folder(&self, name: &OsStr) -> io::Result<()> {
        fs::create_dir(self.0.join(name))
    }

    /// Gives a file or folder in it another name.
    pub fn rename(&self, from: &OsStr, target: &Self, to: &OsStr) -> io::Result<()> {
        fs::rename(self.0.join(from), target.0.join(to))
    }

    /// Removes a file.
    pub fn remove(&self, name: &OsStr) -> io::Result<()> {
        fs::remove_file(self.0.join(name))
    }

    /// Only Unix lets a folder be synchronised; elsewhere the rename itself has to do.
    pub fn sync(&self) -> io::Result<()> {
        Ok(())
    }

    /// A folder has no lock here.
    pub fn lock(&self) -> io::Result<Option<File>> {
        Ok(None)
    }

    /// The names in it; at most `limit`.
    pub fn names(&self, limit: usize) -> io::Result<Vec<OsString>> {
        let mut names = Vec::new();
        for entry in fs::read_dir(&self.0)? {
            if names.len() == limit {
                return Err(FileRefusal::TooMany { limit }.into());
            }
            names.push(entry?.file_name());
        }
        Ok(names)
    }
}

/// Opens a plain file that the operator named; links in its path are followed.
pub(super) fn file_given(path: &Path) -> io::Result<File> {
    kind_of(fs::metadata(path)?.file_type()).check_file()?;
    File::open(path)
}

fn kind_of(kind: FileType) -> EntryKind {
    match kind {
        kind if kind.is_file() => EntryKind::File,
        kind if kind.is_dir() => EntryKind::Folder,
        kind if kind.is_symlink() => EntryKind::Link,
        _ => EntryKind::Other("neither a file nor a folder"),
    }
}
