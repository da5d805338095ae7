//! A part: the rows of a few sessions in a file that proves itself whole.
//!
//! The rows are a table of their own; what follows begins with `#`: the sessions that failed, and the SHA-256 of everything
//! above. A part is written under another name and gets its own when it is safe, so a worker that dies leaves nothing behind
//! that looks done, and two that do the same part write the same bytes.

use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::error::{Problem, StudyError};
use super::plan::Study;
use super::unit_session::{self, Kept};
use crate::fit::{TrialEstimate, fit_header, fit_row};

/// Folder of the parts in that of a study.
pub const PARTS: &str = "parts";

/// How the name of a file begins that is not whole yet.
pub(super) const NEW: &str = ".new-";

/// A part of a study, done or not.
#[derive(Debug, Clone)]
pub struct Part {
    /// Its number, from 0.
    pub number: u64,
    path: PathBuf,
}

/// A part that cannot be used.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}. Run the study again with --resume, which does it anew", .path.display())]
pub struct PartError {
    path: PathBuf,
    problem: &'static str,
}

/// What is in a part that is whole.
#[derive(Debug, Clone, PartialEq)]
pub struct Contents {
    /// The rows, without the header.
    pub rows: String,
    /// The sessions that failed.
    pub failed: Vec<Problem>,
    /// SHA-256 of all of it.
    pub sha256: String,
}

/// The columns of `study.csv`.
pub fn header() -> String {
    format!("subject,{},session\n", fit_header())
}

impl Part {
    /// Part `number` of the study in `folder`.
    pub fn of(folder: &Path, number: u64) -> Self {
        Self { number, path: folder.join(PARTS).join(format!("part-{number:06}.csv")) }
    }

    /// Whether it is done and whole.
    pub fn is_done(&self, study: &Study) -> bool {
        self.read(study).is_ok()
    }

    /// Does its units, as many at once as there are cores, and writes it.
    ///
    /// # Errors
    /// If the file cannot be written. A unit that fails is told of in the part.
    pub fn make(&self, study: &Study, kept: Kept, done: impl Fn() + Sync) -> Result<(), StudyError> {
        let text = text(study, self.number, kept, done);
        write_whole(&self.path, text.as_bytes()).map_err(StudyError::at(&self.path))
    }

    /// Reads it, if it is whole and of this study.
    pub fn read(&self, study: &Study) -> Result<Contents, PartError> {
        let wrong = |problem| PartError { path: self.path.clone(), problem };
        let text = fs::read_to_string(&self.path).map_err(|_| wrong("is not there, or cannot be read"))?;
        let broken = || wrong("is not whole: its checksum is missing or another");
        let (body, sum) = text.rsplit_once("# sha256 ").ok_or_else(broken)?;
        let sha256 = hex(body.as_bytes());
        if sum.strip_suffix('\n') != Some(sha256.as_str()) {
            return Err(broken());
        }
        if !body.contains(&format!("# study {}\n", study.digest())) {
            return Err(wrong("belongs to another study, seed or version of the program"));
        }
        let mut rows = String::with_capacity(body.len());
        let mut failed = Vec::new();
        for line in body.lines().skip(1) {
            match line.strip_prefix("# failed ") {
                Some(told) => failed.extend(parse_failed(told)),
                None if line.starts_with('#') => {}
                None => {
                    rows += line;
                    rows.push('\n');
                }
            }
        }
        Ok(Contents { rows, failed, sha256 })
    }
}

fn text(study: &Study, part: u64, kept: Kept, done: impl Fn() + Sync) -> String {
    let units: Vec<u64> = study.units_of(part).collect();
    let fitted: Vec<Result<String, String>> = units
        .into_par_iter()
        .map(|index| {
            let unit = study.unit(index);
            let rows = unit_session::fit(study, &unit, kept).map_err(|error| {
                let reason = error.to_string().replace(['\n', '\r'], " ");
                format!("# failed {}\n", serde_json::json!([unit.subject, unit.session, reason]))
            });
            done();
            let subject = cell(&unit.subject);
            let line =
                |estimate: &TrialEstimate| format!("{subject},{},{}\n", fit_row(estimate), unit.session);
            rows.map(|estimates| estimates.iter().map(line).collect())
        })
        .collect();
    let mut text = header();
    text.extend(fitted.iter().flatten().map(String::as_str));
    text.extend(fitted.iter().filter_map(|unit| unit.as_ref().err()).map(String::as_str));
    text += &format!("# study {}\n", study.digest());
    let sum = hex(text.as_bytes());
    text + &format!("# sha256 {sum}\n")
}

/// A text cell, in quotes where it needs them; never the beginning of a remark.
fn cell(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r', '#']) {
        format!("\"{}\"", text.replace('"', "\"\"").replace(['\n', '\r'], " "))
    } else {
        text.into()
    }
}

fn parse_failed(told: &str) -> Option<Problem> {
    let (subject, session, reason) = serde_json::from_str(told).ok()?;
    Some(Problem::Failed { subject, session, reason })
}

fn hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes a file that is there whole or not at all, even if two processes, on two machines, write it at once.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let mut builder = tempfile::Builder::new();
    builder.prefix(NEW);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o644));
    let mut file = builder.tempfile_in(folder)?;
    file.write_all(bytes)?;
    file.as_file().sync_data()?;
    file.persist(path).map_err(|error| error.error)?;
    Ok(())
}
