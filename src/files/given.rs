//! Files and folders that the operator names on the command line.

use std::fs;
use std::io;
use std::path::Path;

use super::folder::{as_text, read_limited};
use super::open_at;

/// All bytes of a file that the operator named, which may have at most `limit`. Links are followed; a FIFO or a device is
/// refused.
///
/// # Errors
/// If it cannot be read, is no plain file, or is larger.
pub fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    read_limited(open_at::file_given(path)?, limit)
}

/// The text of a file that the operator named, as [`read`].
///
/// # Errors
/// As [`read`], or if it is not UTF-8.
pub fn read_text(path: &Path, limit: u64) -> io::Result<String> {
    as_text(read(path, limit)?)
}

/// Opens a file that the operator named, as [`read`], for reading it piece by piece.
///
/// # Errors
/// If it cannot be opened or is no plain file.
pub fn open(path: &Path) -> io::Result<fs::File> {
    open_at::file_given(path)
}

/// Whether anything is at a path that the operator named, a link that leads nowhere included.
pub fn exists(path: &Path) -> bool {
    path.symlink_metadata().is_ok()
}

/// Makes a folder that the operator named, and those above it, where they are not there.
///
/// # Errors
/// If one cannot be made.
pub fn make_folders(path: &Path) -> io::Result<()> {
    if path.as_os_str().is_empty() { Ok(()) } else { fs::create_dir_all(path) }
}
