//! Writing so that what was said to be written is there after a crash.

use std::cell::Cell;
use std::fs::{self, File, OpenOptions};
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::time::Duration;

/// All writing of a session goes through here; a test can make any of its operations fail.
#[derive(Debug, Default)]
pub struct Disk {
    operations: Cell<u64>,
    fails_from: Option<(u64, ErrorKind)>,
    takes: Duration,
}

impl Disk {
    /// A disk whose operations fail from the given one on (the first is 0), as a full or dying disk does.
    pub fn failing_from(operation: u64, kind: ErrorKind) -> Self {
        Self { fails_from: Some((operation, kind)), ..Self::default() }
    }

    /// A disk whose operations take so long.
    pub fn slow(takes: Duration) -> Self {
        Self { takes, ..Self::default() }
    }

    /// How many operations there were.
    pub fn operations(&self) -> u64 {
        self.operations.get()
    }

    fn operate(&self) -> io::Result<()> {
        let operation = self.operations.replace(self.operations.get() + 1);
        if !self.takes.is_zero() {
            std::thread::sleep(self.takes);
        }
        match self.fails_from {
            Some((from, kind)) if operation >= from => Err(io::Error::from(kind)),
            _ => Ok(()),
        }
    }

    /// Makes a new folder; one that is there is an error.
    pub fn create_folder(&self, path: &Path) -> io::Result<()> {
        self.operate()?;
        fs::create_dir(path)?;
        self.sync_folder(folder_of(path))
    }

    /// Opens a new file for appending; one that is there is an error.
    pub fn create(&self, path: &Path) -> io::Result<File> {
        self.operate()?;
        OpenOptions::new().append(true).create_new(true).open(path)
    }

    /// Opens a file that is there for appending.
    pub fn open(&self, path: &Path) -> io::Result<File> {
        self.operate()?;
        OpenOptions::new().append(true).open(path)
    }

    /// Cuts a file off at `length`.
    pub fn cut(&self, file: &File, length: u64) -> io::Result<()> {
        self.operate()?;
        file.set_len(length)
    }

    /// Takes away a file that was never finished.
    pub fn remove(&self, path: &Path) -> io::Result<()> {
        self.operate()?;
        fs::remove_file(path)
    }

    /// Appends bytes.
    pub fn append(&self, file: &mut File, bytes: &[u8]) -> io::Result<()> {
        if let Err(error) = self.operate() {
            // A disk that fills up takes some of the bytes first.
            file.write_all(&bytes[..bytes.len() / 2])?;
            return Err(error);
        }
        file.write_all(bytes)
    }

    /// Returns when the data of a file are on the disk.
    pub fn sync(&self, file: &File) -> io::Result<()> {
        self.operate()?;
        file.sync_data()
    }

    /// Writes a whole file: the old one, or none, or all of the new one is there, never a part.
    pub fn write(&self, path: &Path, bytes: &[u8]) -> io::Result<()> {
        let temporary = path.with_added_extension("new");
        self.operate()?;
        let mut file = File::create(&temporary)?;
        self.append(&mut file, bytes)?;
        self.sync(&file)?;
        self.rename(&temporary, path)
    }

    /// Gives a file its name for good.
    pub fn rename(&self, from: &Path, to: &Path) -> io::Result<()> {
        self.operate()?;
        fs::rename(from, to)?;
        self.sync_folder(folder_of(to))
    }

    /// Returns when the names in a folder are on the disk.
    pub fn sync_folder(&self, path: &Path) -> io::Result<()> {
        self.operate()?;
        // Only Unix lets a folder be opened and synchronised; elsewhere the rename itself has to do.
        if cfg!(unix) { File::open(path)?.sync_all() } else { Ok(()) }
    }
}

/// The folder that `path` is in.
fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_file_is_never_seen_half_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trials.csv");
        Disk::default().write(&path, b"old").unwrap();
        let needed = {
            let disk = Disk::default();
            disk.write(&path, b"old").unwrap();
            disk.operations()
        };
        for operation in 0..needed - 1 {
            assert!(Disk::failing_from(operation, ErrorKind::StorageFull).write(&path, b"new").is_err());
            assert_eq!(fs::read(&path).unwrap(), b"old", "failed at operation {operation}");
        }
        Disk::default().write(&path, b"new").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
    }

    #[test]
    fn what_is_there_is_not_created_again() {
        let folder = tempfile::tempdir().unwrap();
        let disk = Disk::default();
        assert_eq!(disk.create_folder(folder.path()).unwrap_err().kind(), ErrorKind::AlreadyExists);
        disk.create(&folder.path().join("journal")).unwrap();
        assert_eq!(disk.create(&folder.path().join("journal")).unwrap_err().kind(), ErrorKind::AlreadyExists);
    }
}
