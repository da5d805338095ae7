//! Seed, folder and subject number of a new session.

use std::hash::{BuildHasher, Hasher, RandomState};
use std::path::{Path, PathBuf};

use crate::files;

/// `path` if it does not exist; otherwise the first of `path-2`, `path-3`, ... that does not exist.
pub fn new_folder(path: &Path) -> PathBuf {
    let numbered = |number: u32| PathBuf::from(format!("{}-{number}", path.display()));
    if !files::exists(path) {
        return path.to_owned();
    }
    (2..).map(numbered).find(|path| !files::exists(path)).unwrap_or_else(|| path.to_owned())
}

/// The number at the end of a subject's identifier, from 1: 3 for `S03`.
pub fn subject_number(id: &str) -> Option<u32> {
    let digits = id.rsplit(|c: char| !c.is_ascii_digit()).next().unwrap_or_default();
    digits.parse().ok().filter(|number| *number > 0)
}

/// A seed from the system's random numbers, short enough to be typed (32 bits).
pub fn draw_seed() -> u64 {
    RandomState::new().build_hasher().finish() >> 32
}
