//! The operating system's calls that open one name in an open folder and follow no link.

use std::ffi::{OsStr, OsString};
use std::fs::{File, OpenOptions};
use std::io;
use std::os::fd::OwnedFd;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;

use rustix::fs::{AtFlags, CWD, FileType, Mode, OFlags, Stat};
use rustix::io::Errno;

use super::entry_kind::EntryKind;
use super::purpose::Purpose;
use super::refusal::FileRefusal;

/// An open folder of the operating system.
#[derive(Debug)]
pub(super) struct FolderHandle(OwnedFd);

const FOLDER: OFlags = OFlags::RDONLY.union(OFlags::DIRECTORY).union(OFlags::CLOEXEC);

impl FolderHandle {
    /// Opens the folder that the operator named; links in its path are followed.
    pub fn given(path: &Path) -> io::Result<Self> {
        Ok(Self(rustix::fs::openat(CWD, path, FOLDER, Mode::empty())?))
    }

    /// Opens a folder in it.
    pub fn folder(&self, name: &OsStr) -> io::Result<Self> {
        match rustix::fs::openat(&self.0, name, FOLDER | OFlags::NOFOLLOW, Mode::empty()) {
            Ok(folder) => Ok(Self(folder)),
            // Linux says ENOTDIR of a link, other systems ELOOP or EMLINK.
            Err(Errno::NOTDIR | Errno::LOOP | Errno::MLINK) => {
                self.kind(name)?.check_folder()?;
                Err(Errno::NOTDIR.into())
            }
            Err(error) => Err(error.into()),
        }
    }

    /// Opens a plain file in it.
    pub fn file(&self, name: &OsStr, purpose: Purpose) -> io::Result<File> {
        let flags = match purpose {
            Purpose::Read => OFlags::RDONLY,
            Purpose::Append => OFlags::WRONLY | OFlags::APPEND,
            Purpose::CreateNew => OFlags::WRONLY | OFlags::APPEND | OFlags::CREATE | OFlags::EXCL,
        };
        if purpose != Purpose::CreateNew {
            // Before it is opened: to open a device can have effects of its own.
            self.kind(name)?.check_file()?;
        }
        // Without O_NONBLOCK, a FIFO that took the place of the file meanwhile would hold the program up.
        let flags = flags | OFlags::NOFOLLOW | OFlags::NONBLOCK | OFlags::CLOEXEC;
        let file = match rustix::fs::openat(&self.0, name, flags, Mode::from_raw_mode(0o666)) {
            Err(Errno::LOOP | Errno::MLINK) => return Err(FileRefusal::Link.into()),
            opened => opened?,
        };
        let status = rustix::fs::fstat(&file)?;
        kind_of(&status).check_file()?;
        if purpose == Purpose::Append && status.st_nlink > 1 {
            return Err(FileRefusal::SharedFile.into());
        }
        Ok(File::from(file))
    }

    /// What a name in it stands for.
    pub fn kind(&self, name: &OsStr) -> io::Result<EntryKind> {
        Ok(kind_of(&rustix::fs::statat(&self.0, name, AtFlags::SYMLINK_NOFOLLOW)?))
    }

    /// Makes a folder, which must not be there.
    pub fn make_folder(&self, name: &OsStr) -> io::Result<()> {
        Ok(rustix::fs::mkdirat(&self.0, name, Mode::from_raw_mode(0o777))?)
    }

    /// Gives a file or folder in it another name. A link under the new name is replaced, not followed.
    pub fn rename(&self, from: &OsStr, target: &Self, to: &OsStr) -> io::Result<()> {
        Ok(rustix::fs::renameat(&self.0, from, &target.0, to)?)
    }

    /// Removes a file. Of a link, the link is removed.
    pub fn remove(&self, name: &OsStr) -> io::Result<()> {
        Ok(rustix::fs::unlinkat(&self.0, name, AtFlags::empty())?)
    }

    /// Returns when the names in it are on the disk.
    pub fn sync(&self) -> io::Result<()> {
        Ok(rustix::fs::fsync(&self.0)?)
    }

    /// Returns when the whole file system that it is in is on the disk.
    #[cfg(target_os = "linux")]
    pub fn sync_file_system(&self) -> io::Result<()> {
        Ok(rustix::fs::syncfs(&self.0)?)
    }

    /// Waits until nobody else holds the lock of the folder; it is given back when the file is closed. `None` where the file system knows
    /// no locks.
    pub fn lock(&self) -> io::Result<Option<File>> {
        // A lock belongs to an opened folder: the own handle may be shared.
        let own = File::from(rustix::fs::openat(&self.0, ".", FOLDER, Mode::empty())?);
        match own.lock() {
            Ok(()) => Ok(Some(own)),
            Err(error) if error.kind() == io::ErrorKind::Unsupported => Ok(None),
            Err(error) if error.raw_os_error() == Some(Errno::BADF.raw_os_error()) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The names in it; at most `limit`.
    pub fn names(&self, limit: usize) -> io::Result<Vec<OsString>> {
        let mut names = Vec::new();
        for entry in rustix::fs::Dir::read_from(&self.0)? {
            let entry = entry?;
            let name = entry.file_name().to_bytes();
            if matches!(name, b"." | b"..") {
                continue;
            }
            if names.len() == limit {
                return Err(FileRefusal::TooMany { limit }.into());
            }
            names.push(OsStr::from_bytes(name).to_owned());
        }
        Ok(names)
    }
}

/// Opens a plain file that the operator named; links in its path are followed.
pub(super) fn file_given(path: &Path) -> io::Result<File> {
    let file = OpenOptions::new().read(true).custom_flags(OFlags::NONBLOCK.bits() as i32).open(path)?;
    kind_of(&rustix::fs::fstat(&file)?).check_file()?;
    Ok(file)
}

fn kind_of(status: &Stat) -> EntryKind {
    match FileType::from_raw_mode(status.st_mode) {
        FileType::RegularFile => EntryKind::File,
        FileType::Directory => EntryKind::Folder,
        FileType::Symlink => EntryKind::Link,
        FileType::Fifo => EntryKind::Other("a FIFO"),
        FileType::Socket => EntryKind::Other("a socket"),
        FileType::CharacterDevice | FileType::BlockDevice => EntryKind::Other("a device"),
        _ => EntryKind::Other("neither a file nor a folder"),
    }
}
