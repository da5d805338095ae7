//! The folder of a study: its plan, its parts and its tables.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::aggregation::{StudySummary, TableOrigin, assemble_table, summarise};
use super::error::{StudyError, StudyIssue};
use super::part::{PARTS_FOLDER, StudyPart, write_whole};
use super::plan::Study;
use super::result_tables::{RESULTS_FILE, RESULTS_FORMAT, ResultTables};
use super::table_reader::TABLE_FILE;
use crate::files::{self, Folder, limits};
use crate::fit::QUANTITIES;

/// Name of the file that identifies the study; it is written first.
pub(super) const PLAN_FILE: &str = "plan.json";

/// A folder that belongs to one study.
#[derive(Debug, Clone)]
pub struct StudyFolder {
    path: PathBuf,
}

impl StudyFolder {
    /// Opens the folder for `study`: a new folder or, with `resume`, one in which the same study was started.
    ///
    /// # Errors
    /// If the folder contains anything else, or the plan cannot be written.
    pub fn open(path: &Path, study: &Study, resume: bool) -> Result<Self, StudyError> {
        let plan = plan(study);
        let file = path.join(PLAN_FILE);
        let refuse = |found: &str, advice| {
            Err(StudyError::Folder { folder: path.to_owned(), found: found.to_owned(), advice })
        };
        if let Ok(there) = files::read_text(&file, limits::SETTINGS_BYTES) {
            if there != plan {
                return refuse(
                    "contains another study, or this study with another seed or version of the program",
                    "give another folder with --out",
                );
            }
            if !resume {
                return refuse(
                    "contains this study, partly or wholly done",
                    "continue it with --resume, or give another --out",
                );
            }
        } else {
            let entries = Folder::open(path).and_then(|folder| folder.entries());
            // Another worker may be creating the folder at this moment.
            let empty = entries
                .map_or(true, |entries| entries.iter().all(|entry| resume && is_study_file(&entry.name)));
            if !empty {
                return refuse("exists and is not empty", "give a new folder with --out");
            }
        }
        files::make_folders(&path.join(PARTS_FOLDER)).map_err(StudyError::at(path))?;
        write_whole(&file, plan.as_bytes()).map_err(StudyError::at(&file))?;
        Ok(Self { path: path.to_owned() })
    }

    /// The seed of the study that was started in `path`; `None` if there is none.
    pub fn seed(path: &Path) -> Option<u64> {
        let text = files::read_text(&path.join(PLAN_FILE), limits::SETTINGS_BYTES).ok()?;
        serde_json::from_str::<Value>(&text).ok()?["seed"].as_u64()
    }

    /// Path of the folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The parts that are not finished.
    pub fn pending_parts(&self, study: &Study) -> Vec<StudyPart> {
        (0..study.parts())
            .map(|number| StudyPart::of(&self.path, number))
            .filter(|part| !part.is_done(study))
            .collect()
    }

    /// Writes `study.csv` and all tables from the parts.
    ///
    /// # Errors
    /// If a part is missing or damaged, or a file cannot be written.
    pub fn write_tables(&self, study: &Study) -> Result<(StudySummary, ResultTables), StudyError> {
        let failed = assemble_table(study, &self.path)?;
        let issues: Vec<StudyIssue> = study.issues.iter().cloned().chain(failed).collect();
        let summary = summarise(&self.path.join(TABLE_FILE), TableOrigin::ThisProgram, &[], issues)?;
        let tables = ResultTables::of(&summary);
        let about = json!({ "name": study.name, "seed": study.seed, "weighting": study.weighting, "fit": study.fit, "units": study.units(),
            "virtual": study.protocol().is_some() });
        write(&self.path, &summary, &tables, &about)?;
        Ok((summary, tables))
    }
}

/// Computes the tables from an existing `study.csv`, which may have been edited, and writes them into `folder`.
pub fn tables_from_csv(table: &Path, folder: &Path) -> Result<(StudySummary, ResultTables), StudyError> {
    let summary = summarise(table, TableOrigin::External, &[], Vec::new())?;
    let tables = ResultTables::of(&summary);
    let is_taken = |name: &str| files::exists(&folder.join(name));
    if is_taken(RESULTS_FILE) || is_taken(TABLE_FILE) || tables.files.iter().any(|table| is_taken(table.name))
    {
        return Err(StudyError::Folder {
            folder: folder.to_owned(),
            found: "contains the tables of a study".to_owned(),
            advice: "give another folder with --out",
        });
    }
    files::make_folders(folder).map_err(StudyError::at(folder))?;
    copy_table(table, folder)?;
    write(folder, &summary, &tables, &json!({}))?;
    Ok((summary, tables))
}

/// Keeps the table with the tables that are made of it, so that the folder holds all that its report shows.
fn copy_table(table: &Path, folder: &Path) -> Result<(), StudyError> {
    let folder = folder.join(INPUT_FOLDER);
    let path = folder.join(TABLE_FILE);
    let copy = || {
        files::make_folders(&folder)?;
        let mut file = Folder::open(&folder)?.begin_file(TABLE_FILE)?;
        std::io::copy(&mut files::open(table)?, file.file())?;
        file.finish()
    };
    copy().map_err(StudyError::at(&path))
}

/// Folder of the table that the tables of a study were made of, where it is not the program's own.
pub(super) const INPUT_FOLDER: &str = "input";

/// Whether a file belongs to a study whose plan is still being written.
fn is_study_file(name: &OsStr) -> bool {
    name == PARTS_FOLDER || name == PLAN_FILE || files::is_unfinished(name)
}

fn plan(study: &Study) -> String {
    let plan = json!({
        "format": "ramphold-study-plan/1",
        "name": study.name,
        "seed": study.seed,
        "units": study.units(),
        "parts": study.parts(),
        "digest": study.digest(),
    });
    format!("{plan:#}\n")
}

fn write(
    folder: &Path,
    summary: &StudySummary,
    tables: &ResultTables,
    about: &Value,
) -> Result<(), StudyError> {
    for table in &tables.files {
        let path = folder.join(table.name);
        write_whole(&path, table.text.as_bytes()).map_err(StudyError::at(&path))?;
    }
    let issues: Vec<String> = summary.issues.iter().map(StudyIssue::to_string).collect();
    let complete: Value = QUANTITIES
        .iter()
        .zip(&summary.complete)
        .map(|(name, moments)| ((*name).to_owned(), json!(moments.count())))
        .collect::<serde_json::Map<_, _>>()
        .into();
    let results = json!({
        "format": RESULTS_FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "study": about,
        "persons": summary.subjects,
        "sessions_each": summary.sessions,
        "persons_with_all_conditions": complete,
        "velocities_rad_s": summary.grid.velocities_rad_s,
        "torques_nm": summary.grid.torques_nm,
        "excluded_sessions": summary.excluded,
        "problem_count": summary.issue_count,
        "problems": issues,
    });
    let path = folder.join(RESULTS_FILE);
    write_whole(&path, format!("{results:#}\n").as_bytes()).map_err(StudyError::at(&path))
}
