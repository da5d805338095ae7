//! The reports of sessions and studies.

use std::path::{Path, PathBuf};

use crate::dataset::{Disk, Session};
use crate::files::Folder;
use crate::report;

use super::console::Console;
use super::failure::Failure;

/// Writes the report of a session, which was read from `folder`, into the folder of its results and prints what the report lacks; gives
/// the page's path.
pub fn write_report(
    folder: &Path,
    session: Session,
    results: &Folder,
    console: &Console,
) -> Result<PathBuf, Failure> {
    write_report_to(folder, session, results, None, results, console)
}

/// Writes the report of the study in `folder` into the folder `out`; gives the page's path.
pub fn write_study_report(folder: &Path, out: &Folder) -> Result<PathBuf, Failure> {
    Ok(report::write_study(folder, out, &Disk::default())?.page)
}

/// Says on standard error which results of a session do not belong to it as it is now, or to each other.
///
/// # Errors
/// If the session or its results cannot be read.
pub fn tell_foreign_results(session: &Path, console: &Console) -> Result<(), Failure> {
    for reason in report::foreign_results(session)? {
        let named = reason.replace("SESSION", &session.display().to_string());
        console.announce(format_args!("{}: {named}", session.display()));
    }
    Ok(())
}

/// As [`write_report`], with a second fit laid beside the first, and into another folder than that of the results.
pub fn write_report_to(
    folder: &Path,
    session: Session,
    results: &Folder,
    beside: Option<&Folder>,
    out: &Folder,
    console: &Console,
) -> Result<PathBuf, Failure> {
    let written = report::write(folder, session, results, beside, out, &Disk::default())?;
    for missing in &written.missing {
        // The page names no folder, so that equal sessions give equal pages.
        console.message(missing.replace("SESSION", &folder.display().to_string()));
    }
    Ok(written.page)
}
