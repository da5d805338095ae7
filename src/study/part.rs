//! A part of a study: the estimates of a few sessions in one file with a checksum.
//!
//! The estimates are a CSV table. Lines that begin with `#` follow: the sessions that failed, the digest of the study, and the
//! SHA-256 of everything above. A part is written to a temporary file that is renamed once it is complete: a worker that is killed
//! leaves no part that looks finished, and two workers that do the same part write the same bytes.

use std::io;
use std::path::{Path, PathBuf};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::error::{PartError, StudyError, StudyIssue};
use super::plan::Study;
use super::unit_session::{SessionStorage, UnitEstimates, fit_unit};
use crate::files::{self, Folder, csv_cell, limits};
use crate::fit::{TrialEstimate, fit_header, fit_row};

/// Name of the folder of the parts, inside the study's folder.
pub const PARTS_FOLDER: &str = "parts";

/// A part of a study, finished or not.
#[derive(Debug, Clone)]
pub struct StudyPart {
    /// Number of the part, from 0.
    pub number: u64,
    path: PathBuf,
}

/// Contents of an intact part.
#[derive(Debug, Clone, PartialEq)]
pub struct PartContents {
    /// The CSV rows, without the header.
    pub rows: String,
    /// The sessions that failed.
    pub failed: Vec<StudyIssue>,
    /// SHA-256 of the part, as hexadecimal digits.
    pub sha256: String,
}

/// Name of the column that says whether a session is in study.csv and in no other table.
pub const EXCLUDED: &str = "excluded";

/// The header line of `study.csv`.
pub fn header() -> String {
    format!("subject,{},session,fit,{EXCLUDED}\n", fit_header())
}

impl StudyPart {
    /// The part with this number of the study in `folder`.
    pub fn of(folder: &Path, number: u64) -> Self {
        Self { number, path: folder.join(PARTS_FOLDER).join(format!("part-{number:06}.csv")) }
    }

    /// Whether the part is finished and intact.
    pub fn is_done(&self, study: &Study) -> bool {
        self.read(study).is_ok()
    }

    /// Fits the units of the part in parallel, calling `done` after each, and writes the file.
    ///
    /// # Errors
    /// If the file cannot be written. A unit that fails is recorded in the file and is no error.
    pub fn run(
        &self,
        study: &Study,
        storage: SessionStorage,
        done: impl Fn() + Sync,
    ) -> Result<(), StudyError> {
        let text = file_text(study, self.number, storage, done);
        write_whole(&self.path, text.as_bytes()).map_err(StudyError::at(&self.path))
    }

    /// Reads the part.
    ///
    /// # Errors
    /// If the file is missing, damaged, or of another study.
    pub fn read(&self, study: &Study) -> Result<PartContents, PartError> {
        let wrong = |problem| PartError { path: self.path.clone(), problem };
        let text = files::read_text(&self.path, limits::STUDY_BYTES)
            .map_err(|_| wrong("is missing or cannot be read"))?;
        let broken = || wrong("is damaged: its checksum is missing or does not match");
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
                Some(record) => failed.extend(parse_failed(record)),
                None if line.starts_with('#') => {}
                None => {
                    rows += line;
                    rows.push('\n');
                }
            }
        }
        Ok(PartContents { rows, failed, sha256 })
    }
}

fn file_text(study: &Study, part: u64, storage: SessionStorage, done: impl Fn() + Sync) -> String {
    let units: Vec<u64> = study.units_of(part).collect();
    let fitted: Vec<Result<String, String>> = units
        .into_par_iter()
        .map(|index| {
            let unit = study.unit(index);
            let rows = fit_unit(study, &unit, storage).map_err(|error| {
                let reason = error.to_string().replace(['\n', '\r'], " ");
                format!("# failed {}\n", serde_json::json!([unit.subject, unit.session, reason]))
            });
            done();
            // A row is a line, and a line that begins with # is a comment.
            let subject = csv_cell(&unit.subject.replace(['\n', '\r'], " "));
            rows.map(|UnitEstimates { trials, fit }| {
                let line = |estimate: &TrialEstimate| {
                    format!(
                        "{subject},{},{},{},{}\n",
                        fit_row(estimate),
                        unit.session,
                        fit.name(),
                        unit.is_excluded
                    )
                };
                trials.iter().map(line).collect()
            })
        })
        .collect();
    let mut text = header();
    text.extend(fitted.iter().flatten().map(String::as_str));
    text.extend(fitted.iter().filter_map(|unit| unit.as_ref().err()).map(String::as_str));
    text += &format!("# study {}\n", study.digest());
    let sum = hex(text.as_bytes());
    text + &format!("# sha256 {sum}\n")
}

fn parse_failed(record: &str) -> Option<StudyIssue> {
    let (subject, session, reason) = serde_json::from_str(record).ok()?;
    Some(StudyIssue::SessionFailed { subject, session, reason })
}

fn hex(bytes: &[u8]) -> String {
    Sha256::digest(bytes).iter().map(|byte| format!("{byte:02x}")).collect()
}

/// Writes a file atomically: readers see the whole file or none, even if two processes on two machines write it at once.
pub(super) fn write_whole(path: &Path, bytes: &[u8]) -> io::Result<()> {
    Folder::open(path.parent().unwrap_or(Path::new("")))?.write(path.file_name().unwrap_or_default(), bytes)
}
