//! The results of a study as its folder holds them, for its report.

use std::path::Path;

use serde::Deserialize;

use super::aggregation::{StudySummary, TableOrigin, summarise};
use super::error::StudyError;
use super::result_tables::{RESULTS_FILE, RESULTS_FORMAT, ResultTables};
use super::study_folder::{INPUT_FOLDER, PLAN_FILE};
use super::table_reader::TABLE_FILE;
use crate::files;
use crate::json_file;

/// What the file should be, for messages.
const EXPECTED: &str = "the study.json of a study";

/// The results of a study.
#[derive(Debug, Clone)]
pub struct StudyResults {
    /// Name of the study; `None` if its tables were made of a table from elsewhere.
    pub name: Option<String>,
    /// Seed of the study.
    pub seed: Option<u64>,
    /// The fit whose values are tested: `session` or `independent`.
    pub fit: Option<String>,
    /// Number of sessions of the study, whether or not they are in the tables.
    pub units: Option<u64>,
    /// Whether nobody was measured: the subjects are virtual.
    pub is_virtual: bool,
    /// Summary of the subjects.
    pub summary: StudySummary,
    /// The tables.
    pub tables: ResultTables,
    /// Why sessions and subjects are not in the tables.
    pub issues: Vec<String>,
    /// Number of these, of which the first hundred are listed.
    pub issue_count: u64,
}

/// The fields of `study.json` that are read.
#[derive(Deserialize)]
struct ResultsFile {
    format: String,
    #[serde(default)]
    study: StudyCard,
    #[serde(default)]
    excluded_sessions: Vec<(String, u32)>,
    problem_count: u64,
    problems: Vec<String>,
}

#[derive(Default, Deserialize)]
struct StudyCard {
    name: Option<String>,
    seed: Option<u64>,
    fit: Option<String>,
    units: Option<u64>,
    #[serde(default, rename = "virtual")]
    is_virtual: bool,
}

/// Whether `folder` is that of a study, finished or not.
pub fn is_study(folder: &Path) -> bool {
    [RESULTS_FILE, PLAN_FILE].iter().any(|name| files::exists(&folder.join(name)))
}

impl StudyResults {
    /// Reads the results in `folder`. The tables are computed from `study.csv` again.
    ///
    /// # Errors
    /// If the study is not finished, or a file is not what it should be.
    pub fn read(folder: &Path) -> Result<Self, StudyError> {
        let path = folder.join(RESULTS_FILE);
        if !files::exists(&path) {
            return Err(StudyError::Folder {
                folder: folder.to_owned(),
                found: "contains a study that is not finished".to_owned(),
                advice: "finish it with: ramphold cohort STUDY --out FOLDER --resume",
            });
        }
        let file: ResultsFile = json_file::read(&path, EXPECTED)?;
        if file.format != RESULTS_FORMAT {
            let (field, found) = ("format".to_owned(), file.format);
            return Err(StudyError::Value { file: path, field, found, expected: RESULTS_FORMAT });
        }
        let (origin, table) = match file.study.name {
            Some(_) => (TableOrigin::ThisProgram, folder.join(TABLE_FILE)),
            None => (TableOrigin::External, folder.join(INPUT_FOLDER).join(TABLE_FILE)),
        };
        let summary = summarise(&table, origin, &file.excluded_sessions, Vec::new())?;
        Ok(Self {
            tables: ResultTables::of(&summary),
            name: file.study.name,
            seed: file.study.seed,
            fit: file.study.fit,
            units: file.study.units,
            is_virtual: file.study.is_virtual,
            summary,
            issues: file.problems,
            issue_count: file.problem_count,
        })
    }
}
