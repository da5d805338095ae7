//! The folder that results go into: the session's own, one inside it, or one that the operator named.

use std::io;
use std::path::{Path, PathBuf};

use crate::dataset::open_session;
use crate::files::{self, Folder, FolderLock};

use super::failure::Failure;

/// Name of the folder of results in a session.
pub(super) const RESULTS: &str = "results";

/// Where the results of a session go.
#[derive(Debug, Clone)]
pub enum ResultsFolder {
    /// The folder of results of the session in this folder; new results replace the last ones.
    OfSession(PathBuf),
    /// A folder inside that of the session, for results of other settings than those there.
    Named {
        /// The session's folder.
        session: PathBuf,
        /// Name inside the folder of results.
        name: String,
    },
    /// A folder that the operator named with `--out`; nothing in it is replaced.
    Given(PathBuf),
}

impl ResultsFolder {
    /// Its path.
    pub fn path(&self) -> PathBuf {
        match self {
            Self::OfSession(session) => session.join(RESULTS),
            Self::Named { session, name } => session.join(RESULTS).join(name),
            Self::Given(path) => path.clone(),
        }
    }

    /// Opens the folder, and makes it if it is not there.
    ///
    /// # Errors
    /// If it cannot be made, or the session's own is a link.
    pub fn open(&self) -> Result<Folder, Failure> {
        let opened = match self {
            Self::OfSession(session) => open_session(session)?.folder_made(RESULTS),
            Self::Named { session, name } => {
                open_session(session)?.folder_made(RESULTS).and_then(|results| results.folder_made(name))
            }
            Self::Given(path) => open_given(path),
        };
        opened.map_err(|source| Failure::ResultsFolder { path: self.path(), source })
    }
}

/// Waits until no other program writes results into the session in the folder `session`, and keeps the others waiting until it is dropped: a
/// place for results is chosen, filled and noted in the manifest by one at a time.
///
/// # Errors
/// If it is no session folder, or cannot be locked.
pub fn lock_results(session: &Path) -> Result<FolderLock, Failure> {
    let failed = |source| Failure::ResultsFolder { path: session.join(RESULTS), source };
    open_session(session)?.lock().map_err(failed)
}

/// Opens a folder that the operator named, and makes it if it is not there.
fn open_given(path: &Path) -> io::Result<Folder> {
    files::make_folders(path)?;
    Folder::open(path)
}

/// Checks a folder or file that the operator named for output: it must not be the root of the file system, nor lie in a
/// session, which consists of what was measured and its own results.
///
/// # Errors
/// If it is or does.
pub fn check_out(option: &str, path: &Path) -> Result<(), Failure> {
    let refuse = |why: String| Err(Failure::Usage(format!("{option} {}: {why}", path.display())));
    // Of a path that is not there yet, the part that is there decides.
    let absolute = std::path::absolute(path)?;
    let there = absolute.ancestors().find_map(|part| part.canonicalize().ok()).unwrap_or(absolute.clone());
    if absolute.parent().is_none() || (there.parent().is_none() && files::exists(path)) {
        return refuse("is the root of the file system; give a new folder".to_owned());
    }
    match there.ancestors().find(|folder| files::exists(&folder.join("session.json"))) {
        Some(session) => refuse(format!(
            "lies in the session {}, which keeps only what was measured and its own results; give a folder outside it",
            session.display()
        )),
        None => Ok(()),
    }
}

/// The folder in `out` for the results of each of `folders`: `out` itself for the only one, else one in it with the same name.
///
/// # Errors
/// If two would share one.
pub fn folders_in(out: &Path, folders: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let folder = |own: &PathBuf| match own.file_name() {
        Some(name) if folders.len() > 1 => out.join(name),
        _ => out.to_owned(),
    };
    let all: Vec<PathBuf> = folders.iter().map(folder).collect();
    match all.iter().enumerate().find(|(index, own)| all[..*index].contains(own)) {
        None => Ok(all),
        Some((_, shared)) => Err(Failure::Usage(format!(
            "two sessions have the folder name {}, so with --out their results would share one folder; do them separately",
            shared.file_name().unwrap_or_default().display()
        ))),
    }
}

/// Checks that a folder that the operator named has none of the files or folders with these names, so that nothing is
/// replaced and nothing of one session stands beside results of another.
///
/// # Errors
/// If it has.
pub fn check_has_none(option: &str, folder: &Path, names: &[&str]) -> Result<(), Failure> {
    match names.iter().find(|name| files::exists(&folder.join(name))) {
        None => Ok(()),
        Some(name) => Err(Failure::Usage(format!(
            "{}: contains the results of an earlier run ({name}), which are not overwritten; give another {option}",
            folder.display()
        ))),
    }
}
