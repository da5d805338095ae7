//! All files below a folder, and what was left unfinished there.

use std::io::{self, Read};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::entry_kind::EntryKind;
use super::folder::{Folder, FolderEntry};
use super::limits;
use super::refusal::{FileRefusal, is_refusal};
use super::whole_file;

/// Bytes that are read at a time.
const PIECE: usize = 64 << 10;

/// A file below a folder.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TreeFile {
    /// Its path from the folder.
    pub path: PathBuf,
    /// Whether it is a plain file: a link, a FIFO and a device are not.
    pub kind: EntryKind,
}

impl Folder {
    /// Everything below the folder that is not itself a folder, links included, which are not followed.
    ///
    /// # Errors
    /// If a folder cannot be read, or there are too many of them inside each other, or too many files.
    pub fn tree(&self) -> io::Result<Vec<TreeFile>> {
        let mut found = Vec::new();
        let mut left = limits::MAX_ENTRIES;
        let mut open = vec![(PathBuf::new(), 0)];
        while let Some((path, depth)) = open.pop() {
            if depth > limits::MAX_DEPTH {
                return Err(FileRefusal::TooDeep { limit: limits::MAX_DEPTH }.into());
            }
            let entries = self.folder(&path)?.entries_up_to(left).map_err(|error| match error {
                // The limit is that of the whole tree.
                error if is_refusal(&error) => FileRefusal::TooMany { limit: limits::MAX_ENTRIES }.into(),
                error => error,
            })?;
            left -= entries.len();
            for entry in entries {
                let path = path.join(entry.name);
                match entry.kind {
                    EntryKind::Folder => open.push((path, depth + 1)),
                    kind => found.push(TreeFile { path, kind }),
                }
            }
        }
        Ok(found)
    }

    /// Returns when everything below the folder is on the disk. On Linux one call takes the whole file system, which is faster than one
    /// for each file.
    ///
    /// # Errors
    /// If the disk fails; elsewhere than on Linux also as [`Folder::tree`].
    pub fn sync_tree(&self) -> io::Result<()> {
        #[cfg(target_os = "linux")]
        return self.sync_file_system();
        #[cfg(not(target_os = "linux"))]
        {
            for file in self.tree()?.iter().filter(|file| file.kind == EntryKind::File) {
                self.open_file(&file.path)?.sync_all()?;
                self.sync_names(&file.path)?;
            }
            Ok(())
        }
    }

    /// Length and SHA-256 in hexadecimal digits of a plain file, which is read piece by piece.
    ///
    /// # Errors
    /// As [`Folder::open_file`], or if it cannot be read.
    pub fn sum(&self, name: impl AsRef<Path>) -> io::Result<(u64, String)> {
        let mut file = self.open_file(name)?;
        let mut piece = vec![0; PIECE];
        let (mut bytes, mut sum) = (0, Sha256::new());
        loop {
            let read = match file.read(&mut piece) {
                Ok(0) => break,
                Ok(read) => read,
                Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
                Err(error) => return Err(error),
            };
            sum.update(&piece[..read]);
            bytes += read as u64;
        }
        Ok((bytes, sum.finalize().iter().map(|byte| format!("{byte:02x}")).collect()))
    }

    /// The names in the folder of files that were never finished: those of [`Folder::begin_file`] after the program died.
    ///
    /// # Errors
    /// If the folder cannot be read.
    pub fn unfinished_files(&self) -> io::Result<Vec<PathBuf>> {
        let is_unfinished =
            |entry: &FolderEntry| entry.kind == EntryKind::File && whole_file::is_unfinished(&entry.name);
        Ok(self.entries()?.into_iter().filter(is_unfinished).map(|entry| entry.name.into()).collect())
    }
}
