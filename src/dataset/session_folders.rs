//! The session folders among the folders that the operator names.

use std::path::{Path, PathBuf};

use super::error::{DatasetError, FilePlace};
use crate::files::{EntryKind, FileRefusal, Folder};

/// The session folders among and directly inside the folders given.
///
/// A folder that holds neither a session nor sessions is passed on, so that reading it says what is missing. A link inside a
/// folder is not followed: it may lead anywhere.
///
/// # Errors
/// If a folder cannot be read, a link in it leads to a session, or a session is given twice.
pub fn session_folders(given: &[PathBuf]) -> Result<Vec<PathBuf>, DatasetError> {
    let mut found = Vec::new();
    for path in given {
        let Some(folder) = Folder::open(path).ok().filter(|folder| !is_session(folder)) else {
            found.push(path.clone());
            continue;
        };
        let mut inside = sessions_in(&folder)?;
        if inside.is_empty() {
            found.push(path.clone());
        }
        found.append(&mut inside);
    }
    // Links and ways with .. lead to the same place by another name.
    let place = |folder: &PathBuf| folder.canonicalize().unwrap_or_else(|_| folder.clone());
    let places: Vec<PathBuf> = found.iter().map(place).collect();
    if let Some(index) = (1..places.len()).find(|index| places[..*index].contains(&places[*index])) {
        let at = FilePlace::file(found[index].display().to_string());
        return Err(DatasetError::GivenTwice { at });
    }
    Ok(found)
}

fn sessions_in(folder: &Folder) -> Result<Vec<PathBuf>, DatasetError> {
    let failed = |path: &Path| {
        let at = FilePlace::file(path.display().to_string());
        move |source| DatasetError::Unreadable { at, source }
    };
    let mut inside = Vec::new();
    for entry in folder.entries().map_err(failed(folder.path()))? {
        let path = folder.path_of(&entry.name);
        match entry.kind {
            EntryKind::Folder if folder.folder(&entry.name).is_ok_and(|folder| is_session(&folder)) => {
                inside.push(path);
            }
            EntryKind::Link if Folder::open(&path).is_ok_and(|folder| is_session(&folder)) => {
                return Err(failed(&path)(FileRefusal::Link.into()));
            }
            _ => {}
        }
    }
    Ok(inside)
}

/// Whether a folder is that of a session.
pub fn is_session(folder: &Folder) -> bool {
    folder.contains("session.json")
}
