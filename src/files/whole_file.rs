//! A file that gets its name once it is complete.

use std::ffi::{OsStr, OsString};
use std::fs::File;
use std::io;
use std::path::Path;

use super::folder::Folder;

/// Ending of the name of a file that is not complete.
const UNFINISHED: &str = ".new";

/// Digits of the random part of such a name.
const RANDOM_DIGITS: usize = 16;

/// A file that is being written under a random name. Dropped before it is finished, it is removed.
#[derive(Debug)]
pub struct WholeFile {
    file: File,
    folder: Folder,
    temporary: OsString,
    name: OsString,
    is_finished: bool,
}

impl Folder {
    /// Begins a file that gets its name once it is complete.
    ///
    /// # Errors
    /// If the folder cannot be written.
    pub fn begin_file(&self, name: impl AsRef<Path>) -> io::Result<WholeFile> {
        let (parent, last) = self.parent_of(name.as_ref())?;
        WholeFile::begin(parent, last)
    }

    /// Writes a whole file: the old one, or all of the new one is there, never a part.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, name: impl AsRef<Path>, bytes: &[u8]) -> io::Result<()> {
        let mut file = self.begin_file(name)?;
        io::Write::write_all(file.file(), bytes)?;
        file.finish()
    }
}

impl WholeFile {
    pub(super) fn begin(folder: Folder, name: &OsStr) -> io::Result<Self> {
        loop {
            let temporary = temporary_name(name)?;
            match folder.create_file(&temporary) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                created => {
                    return Ok(Self {
                        file: created?,
                        folder,
                        temporary,
                        name: name.to_owned(),
                        is_finished: false,
                    });
                }
            }
        }
    }

    /// The file, for writing.
    pub fn file(&mut self) -> &mut File {
        &mut self.file
    }

    /// Gives the file its name. What was there under that name is replaced; of a link, the link. Its bytes are on the disk
    /// only if they were synchronised before.
    ///
    /// # Errors
    /// If it cannot be renamed, as when a folder has its name.
    pub fn rename(&mut self) -> io::Result<()> {
        if !self.is_finished {
            self.folder.rename(&self.temporary, &self.name)?;
            self.is_finished = true;
        }
        Ok(())
    }

    /// Returns when the file is on the disk under its name.
    ///
    /// # Errors
    /// If it cannot be written to the disk, or cannot be renamed.
    pub fn finish(mut self) -> io::Result<()> {
        if !self.is_finished {
            self.file.sync_data()?;
            self.rename()?;
        }
        self.folder.sync_names(&self.name)
    }
}

impl Drop for WholeFile {
    fn drop(&mut self) {
        if !self.is_finished {
            // It would only be in the way; `resume` takes it away otherwise.
            let _ = self.folder.remove(&self.temporary);
        }
    }
}

/// `.trials.csv.0123456789abcdef.new`.
fn temporary_name(name: &OsStr) -> io::Result<OsString> {
    let mut random = [0; RANDOM_DIGITS / 2];
    getrandom::fill(&mut random).map_err(io::Error::other)?;
    let mut temporary = OsString::from(".");
    temporary.push(name);
    temporary.push(format!(".{:016x}{UNFINISHED}", u64::from_ne_bytes(random)));
    Ok(temporary)
}

/// Whether a name is that of a file that was never finished, by this version of the program or an earlier one.
pub fn is_unfinished(name: &OsStr) -> bool {
    let Some(stem) = name.to_str().and_then(|name| name.strip_suffix(UNFINISHED)) else { return false };
    let is_random =
        |text: &str| text.len() == RANDOM_DIGITS && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let is_hidden =
        stem.starts_with('.') && stem.rsplit_once('.').is_some_and(|(_, random)| is_random(random));
    is_hidden || [".csv", ".json", ".html", ".svg"].iter().any(|ending| stem.ends_with(ending))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_has_its_name_only_when_it_is_complete() {
        let place = tempfile::tempdir().unwrap();
        let folder = Folder::open(place.path()).unwrap();
        folder.write("trials.csv", b"old").unwrap();
        let mut file = folder.begin_file("trials.csv").unwrap();
        io::Write::write_all(file.file(), b"new").unwrap();
        let names = || folder.entries().unwrap().into_iter().map(|entry| entry.name).collect::<Vec<_>>();
        assert_eq!(folder.read("trials.csv", 10).unwrap(), b"old");
        assert!(names().len() == 2 && names().iter().any(|name| is_unfinished(name)), "{:?}", names());
        drop(file);
        assert_eq!(names(), ["trials.csv"]);
        folder.write("trials.csv", b"new").unwrap();
        assert_eq!((folder.read("trials.csv", 10).unwrap(), names().len()), (b"new".to_vec(), 1));
    }

    #[test]
    fn only_the_names_of_unfinished_files_are_taken_for_such() {
        for name in [".fit.json.0123456789abcdef.new", "trials.csv.new", "report.html.new"] {
            assert!(is_unfinished(OsStr::new(name)), "{name}");
        }
        for name in ["note.new", "new", ".note.new", ".a.012345678.new", "trials.csv"] {
            assert!(!is_unfinished(OsStr::new(name)), "{name}");
        }
    }
}
