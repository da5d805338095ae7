//! A folder whose tree is opened without following links.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io::{self, Read};
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use super::entry_kind::EntryKind;
use super::limits;
use super::open_at::FolderHandle;
use super::purpose::Purpose;
use super::refusal::FileRefusal;

/// An open folder. Names are paths inside it, with `/`; none of their parts may be a link.
///
/// ```
/// use ramphold::files::Folder;
///
/// let place = tempfile::tempdir()?;
/// std::os::unix::fs::symlink("/etc/hostname", place.path().join("session.json"))?;
/// let error = Folder::open(place.path())?.read("session.json", 1000).unwrap_err();
/// assert!(error.to_string().starts_with("it is a symbolic link"));
/// # Ok::<(), std::io::Error>(())
/// ```
#[derive(Debug, Clone)]
pub struct Folder {
    handle: Arc<FolderHandle>,
    shown: PathBuf,
}

/// Keeps others that ask for the lock of a folder waiting until it is dropped.
#[derive(Debug)]
pub struct FolderLock {
    /// `None` where the file system has no locks: then nobody waits.
    _file: Option<File>,
}

/// What lies in a folder under a name.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct FolderEntry {
    /// The name.
    pub name: OsString,
    /// What it stands for.
    pub kind: EntryKind,
}

impl Folder {
    /// Opens a folder that the operator named; links in `path` are followed.
    ///
    /// # Errors
    /// If it is not there, is no folder, or cannot be opened.
    pub fn open(path: &Path) -> io::Result<Self> {
        let here = if path.as_os_str().is_empty() { Path::new(".") } else { path };
        Ok(Self { handle: Arc::new(FolderHandle::given(here)?), shown: path.to_owned() })
    }

    /// The folder under another name, after it was renamed.
    pub fn renamed(self, path: &Path) -> Self {
        Self { shown: path.to_owned(), ..self }
    }

    /// Path of the folder, as the operator would type it.
    pub fn path(&self) -> &Path {
        &self.shown
    }

    /// Path of a file in it, for messages.
    pub fn path_of(&self, name: impl AsRef<Path>) -> PathBuf {
        self.shown.join(name)
    }

    /// Opens a folder in it.
    ///
    /// # Errors
    /// If it is not there, is no folder, or a part of the path is a link.
    pub fn folder(&self, name: impl AsRef<Path>) -> io::Result<Self> {
        let mut handle = self.handle.clone();
        for part in parts(name.as_ref())? {
            handle = Arc::new(handle.folder(part)?);
        }
        Ok(Self { handle, shown: self.shown.join(name) })
    }

    /// Opens a folder in it, and makes it if it is not there.
    ///
    /// # Errors
    /// As [`Folder::folder`], or if it cannot be made.
    pub fn folder_made(&self, name: impl AsRef<Path>) -> io::Result<Self> {
        let (parent, last) = self.parent_of(name.as_ref())?;
        match parent.handle.make_folder(last) {
            Err(error) if error.kind() != io::ErrorKind::AlreadyExists => Err(error),
            _ => parent.folder(last),
        }
    }

    /// Makes a folder, which must not be there.
    ///
    /// # Errors
    /// If it is there or cannot be made.
    pub fn make_folder(&self, name: impl AsRef<Path>) -> io::Result<Self> {
        let (parent, last) = self.parent_of(name.as_ref())?;
        parent.handle.make_folder(last)?;
        parent.folder(last)
    }

    /// Waits until no other program, nor another part of this one, holds the lock of the folder.
    ///
    /// # Errors
    /// If it cannot be locked.
    pub fn lock(&self) -> io::Result<FolderLock> {
        Ok(FolderLock { _file: self.handle.lock()? })
    }

    /// The folder that `name` is in, and the last part of `name`.
    pub(super) fn parent_of<'name>(&self, name: &'name Path) -> io::Result<(Self, &'name OsStr)> {
        let mut parts = parts(name)?;
        let Some(last) = parts.pop() else { return Err(FileRefusal::Outside.into()) };
        let mut handle = self.handle.clone();
        for part in parts {
            handle = Arc::new(handle.folder(part)?);
        }
        let shown = self.shown.join(name);
        Ok((Self { handle, shown: shown.parent().unwrap_or(&self.shown).to_owned() }, last))
    }

    /// What lies under a name; `None` if nothing does.
    ///
    /// # Errors
    /// If a part of the path is a link, or the folder cannot be read.
    pub fn kind(&self, name: impl AsRef<Path>) -> io::Result<Option<EntryKind>> {
        match self.parent_of(name.as_ref()).and_then(|(parent, last)| parent.handle.kind(last)) {
            Ok(kind) => Ok(Some(kind)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Whether anything lies under a name, a link included. What cannot be told counts as there, so that it is not passed over.
    pub fn contains(&self, name: impl AsRef<Path>) -> bool {
        !matches!(self.kind(name), Ok(None))
    }

    /// Opens a plain file for reading.
    ///
    /// # Errors
    /// If it is not there, is anything but a plain file, or cannot be opened.
    pub fn open_file(&self, name: impl AsRef<Path>) -> io::Result<File> {
        self.file(name.as_ref(), Purpose::Read)
    }

    /// Length of a plain file, bytes.
    ///
    /// # Errors
    /// As [`Folder::open_file`].
    pub fn length(&self, name: impl AsRef<Path>) -> io::Result<u64> {
        Ok(self.open_file(name)?.metadata()?.len())
    }

    /// Opens a plain file for appending. A file with a second name is refused: it would change under both.
    ///
    /// # Errors
    /// As [`Folder::open_file`].
    pub fn append_to(&self, name: impl AsRef<Path>) -> io::Result<File> {
        self.file(name.as_ref(), Purpose::Append)
    }

    /// Makes a new file and opens it for appending; one that is there is an error.
    ///
    /// # Errors
    /// If it is there or cannot be made.
    pub fn create_file(&self, name: impl AsRef<Path>) -> io::Result<File> {
        self.file(name.as_ref(), Purpose::CreateNew)
    }

    fn file(&self, name: &Path, purpose: Purpose) -> io::Result<File> {
        let (parent, last) = self.parent_of(name)?;
        parent.handle.file(last, purpose)
    }

    /// All bytes of a plain file, which may have at most `limit`.
    ///
    /// # Errors
    /// As [`Folder::open_file`], or if the file is larger.
    pub fn read(&self, name: impl AsRef<Path>, limit: u64) -> io::Result<Vec<u8>> {
        read_limited(self.open_file(name)?, limit)
    }

    /// As [`Folder::read`]; `None` if nothing lies under the name.
    ///
    /// # Errors
    /// As [`Folder::read`].
    pub fn read_if_there(&self, name: impl AsRef<Path>, limit: u64) -> io::Result<Option<Vec<u8>>> {
        match self.read(name, limit) {
            Ok(bytes) => Ok(Some(bytes)),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// The text of a plain file, as [`Folder::read`].
    ///
    /// # Errors
    /// As [`Folder::read`], or if it is not UTF-8.
    pub fn read_text(&self, name: impl AsRef<Path>, limit: u64) -> io::Result<String> {
        as_text(self.read(name, limit)?)
    }

    /// Gives a file in this folder another name in it.
    ///
    /// # Errors
    /// If a part of a path is a link, or the file cannot be renamed.
    pub fn rename(&self, from: impl AsRef<Path>, to: impl AsRef<Path>) -> io::Result<()> {
        let (from, to) = (self.parent_of(from.as_ref())?, self.parent_of(to.as_ref())?);
        from.0.handle.rename(from.1, &to.0.handle, to.1)
    }

    /// Removes a file. Of a link, the link is removed.
    ///
    /// # Errors
    /// If a part of the path before it is a link, or it cannot be removed.
    pub fn remove(&self, name: impl AsRef<Path>) -> io::Result<()> {
        let (parent, last) = self.parent_of(name.as_ref())?;
        parent.handle.remove(last)
    }

    /// Returns when the names in the folder that `name` is in are on the disk.
    ///
    /// # Errors
    /// If the disk fails.
    pub fn sync_names(&self, name: impl AsRef<Path>) -> io::Result<()> {
        let (parent, _) = self.parent_of(name.as_ref())?;
        parent.handle.sync()
    }

    #[cfg(target_os = "linux")]
    pub(super) fn sync_file_system(&self) -> io::Result<()> {
        self.handle.sync_file_system()
    }

    /// What lies in the folder, by name.
    ///
    /// # Errors
    /// If the folder cannot be read or has too many entries.
    pub fn entries(&self) -> io::Result<Vec<FolderEntry>> {
        self.entries_up_to(limits::MAX_ENTRIES)
    }

    pub(super) fn entries_up_to(&self, limit: usize) -> io::Result<Vec<FolderEntry>> {
        let mut names = self.handle.names(limit)?;
        names.sort();
        let entry = |name: OsString| match self.handle.kind(&name) {
            Ok(kind) => Some(Ok(FolderEntry { name, kind })),
            // Another program has taken it away meanwhile.
            Err(error) if error.kind() == io::ErrorKind::NotFound => None,
            Err(error) => Some(Err(error)),
        };
        names.into_iter().filter_map(entry).collect()
    }
}

/// The parts of a path inside a folder. `..` takes one back, and is refused where none is left.
fn parts(path: &Path) -> io::Result<Vec<&OsStr>> {
    let mut parts = Vec::new();
    for component in path.components() {
        match component {
            Component::Normal(part) => parts.push(part),
            Component::CurDir => {}
            Component::ParentDir if parts.pop().is_some() => {}
            _ => return Err(FileRefusal::Outside.into()),
        }
    }
    Ok(parts)
}

/// All bytes of an open file, which may have at most `limit`.
pub(super) fn read_limited(file: File, limit: u64) -> io::Result<Vec<u8>> {
    let expected = file.metadata()?.len();
    if expected > limit {
        return Err(FileRefusal::TooLarge { limit }.into());
    }
    let mut bytes = Vec::with_capacity(expected as usize);
    file.take(limit + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > limit { Err(FileRefusal::TooLarge { limit }.into()) } else { Ok(bytes) }
}

pub(super) fn as_text(bytes: Vec<u8>) -> io::Result<String> {
    String::from_utf8(bytes)
        .map_err(|_| io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text; save it as UTF-8"))
}

#[cfg(test)]
mod tests;
