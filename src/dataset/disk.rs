//! Writing so that what was said to be written is there after a crash of the machine. A session of a virtual rig in simulated time can be
//! made again from its seed, so it may promise this for its end alone.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, ErrorKind, Write};
use std::path::Path;
use std::time::Duration;

use crate::files::Folder;

/// All writing of a session goes through here; a test can make any of its operations fail.
#[derive(Debug, Default)]
pub struct Disk {
    operations: Cell<u64>,
    fails_from: Option<(u64, ErrorKind)>,
    takes: Duration,
    /// Files are synchronised by [`Disk::settle`] alone.
    settles: bool,
}

impl Disk {
    /// A disk that hands every write to the operating system at once, so that the death of the program takes nothing, and that is
    /// synchronised by [`Disk::settle`] alone. Only for sessions that can be made again from their seed.
    pub fn synchronised_at_the_end() -> Self {
        Self { settles: true, ..Self::default() }
    }

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
    pub fn create_folder(&self, parent: &Folder, name: impl AsRef<Path>) -> io::Result<Folder> {
        self.operate()?;
        let folder = parent.make_folder(name.as_ref())?;
        self.sync_names(parent, name)?;
        Ok(folder)
    }

    /// Opens a new file for appending; one that is there is an error.
    pub fn create(&self, folder: &Folder, name: &str) -> io::Result<File> {
        self.operate()?;
        folder.create_file(name)
    }

    /// Opens a file that is there for appending.
    pub fn open(&self, folder: &Folder, name: &str) -> io::Result<File> {
        self.operate()?;
        folder.append_to(name)
    }

    /// Cuts a file off at `length`.
    pub fn cut(&self, file: &File, length: u64) -> io::Result<()> {
        self.operate()?;
        file.set_len(length)
    }

    /// Takes away a file that was never finished.
    pub fn remove(&self, folder: &Folder, name: impl AsRef<Path>) -> io::Result<()> {
        self.operate()?;
        folder.remove(name)
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

    /// Returns when the data of a file are on the disk, unless the disk is synchronised at the end.
    pub fn sync(&self, file: &File) -> io::Result<()> {
        self.operate()?;
        if self.settles { Ok(()) } else { file.sync_data() }
    }

    /// Returns when everything below `folder` is on the disk, if it is not so already.
    pub fn settle(&self, folder: &Folder) -> io::Result<()> {
        if !self.settles {
            return Ok(());
        }
        self.operate()?;
        folder.sync_tree()
    }

    /// Writes a whole file: the old one, or none, or all of the new one is there, never a part.
    pub fn write(&self, folder: &Folder, name: impl AsRef<Path>, bytes: &[u8]) -> io::Result<()> {
        self.operate()?;
        let mut file = folder.begin_file(name)?;
        self.append(file.file(), bytes)?;
        self.sync(file.file())?;
        self.operate()?;
        file.rename()?;
        self.operate()?;
        if self.settles { Ok(()) } else { file.finish() }
    }

    /// Gives a file its name for good.
    pub fn rename(&self, folder: &Folder, from: &str, to: &str) -> io::Result<()> {
        self.operate()?;
        folder.rename(from, to)?;
        self.sync_names(folder, to)
    }

    /// Returns when the names in the folder that `name` is in are on the disk.
    pub fn sync_names(&self, folder: &Folder, name: impl AsRef<Path>) -> io::Result<()> {
        self.operate()?;
        if self.settles { Ok(()) } else { folder.sync_names(name) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_whole_file_is_never_seen_half_written() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::open(place.path()).unwrap();
        let write = |disk: &Disk, bytes: &[u8]| disk.write(&folder, "trials.csv", bytes);
        let read = || folder.read("trials.csv", 10).unwrap();
        let disk = Disk::default();
        write(&disk, b"old").unwrap();
        for operation in 0..disk.operations() - 1 {
            assert!(write(&Disk::failing_from(operation, ErrorKind::StorageFull), b"new").is_err());
            assert_eq!(read(), b"old", "failed at operation {operation}");
        }
        write(&Disk::default(), b"new").unwrap();
        assert_eq!(read(), b"new");
    }

    #[test]
    fn a_disk_that_is_synchronised_at_the_end_writes_the_same_files_and_fails_when_settling_fails() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::open(place.path()).unwrap();
        let disk = Disk::synchronised_at_the_end();
        disk.create_folder(&folder, "trials").unwrap();
        disk.write(&folder, "trials/trials.csv", b"all of it").unwrap();
        assert_eq!(folder.read("trials/trials.csv", 10).unwrap(), b"all of it");
        assert_eq!(folder.tree().unwrap().len(), 1, "no temporary file is left");
        disk.settle(&folder).unwrap();
        let failing = Disk { settles: true, ..Disk::failing_from(0, ErrorKind::StorageFull) };
        assert_eq!(failing.settle(&folder).unwrap_err().kind(), ErrorKind::StorageFull);
        // Another disk has synchronised everything already.
        let operations = disk.operations();
        Disk::failing_from(0, ErrorKind::StorageFull).settle(&folder).unwrap();
        assert_eq!(disk.operations(), operations);
    }

    #[test]
    fn what_is_there_is_not_created_again() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::open(place.path()).unwrap();
        let disk = Disk::default();
        disk.create_folder(&folder, "trials").unwrap();
        assert_eq!(disk.create_folder(&folder, "trials").unwrap_err().kind(), ErrorKind::AlreadyExists);
        disk.create(&folder, "journal").unwrap();
        assert_eq!(disk.create(&folder, "journal").unwrap_err().kind(), ErrorKind::AlreadyExists);
    }
}
