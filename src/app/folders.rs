//! The session folders that the command line names.

use std::path::{Path, PathBuf};

use super::failure::Failure;

/// The session folders among and directly inside the folders given.
///
/// A folder that holds neither a session nor sessions is passed on, so that reading it says what is missing.
pub fn session_folders(given: &[PathBuf]) -> Result<Vec<PathBuf>, Failure> {
    let is_session = |folder: &Path| folder.join("session.json").exists();
    let mut found = Vec::new();
    for folder in given {
        if is_session(folder) || !folder.is_dir() {
            found.push(folder.clone());
            continue;
        }
        let entries = std::fs::read_dir(folder)
            .map_err(|source| Failure::Read { file: folder.display().to_string(), source })?;
        let mut inside: Vec<PathBuf> = entries
            .filter_map(|entry| entry.ok().map(|e| e.path()))
            .filter(|path| is_session(path))
            .collect();
        inside.sort();
        if inside.is_empty() {
            found.push(folder.clone());
        }
        found.append(&mut inside);
    }
    Ok(found)
}
