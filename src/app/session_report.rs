//! The report of a session.

use std::path::{Path, PathBuf};

use crate::dataset::Disk;
use crate::files::Folder;
use crate::report;

use super::console::Console;
use super::failure::Failure;

/// Writes the report of a session into the folder of its results and prints what the report lacks; gives the page's path.
pub fn write_report(session: &Path, results: &Folder, console: &Console) -> Result<PathBuf, Failure> {
    let written = report::write(session, results, &Disk::default())?;
    for missing in &written.missing {
        console.message(missing);
    }
    Ok(written.page)
}
