//! The folder of a study: which study it is, its parts, and what was gathered from them.

use std::ffi::OsStr;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use super::aggregation::{Gathered, Origin, assemble, gather};
use super::error::{Problem, StudyError};
use super::part::{NEW, PARTS, Part, write_whole};
use super::plan::Study;
use super::tables::{RESULTS_FORMAT, Tables};
use crate::fit::QUANTITIES;

/// What the folder is for; the first file in it.
const PLAN: &str = "plan.json";

/// A folder that belongs to a study.
#[derive(Debug, Clone)]
pub struct StudyFolder {
    path: PathBuf,
}

impl StudyFolder {
    /// Takes the folder for `study`: a new one, or one in which the same study was begun if `go_on`.
    pub fn take(path: &Path, study: &Study, go_on: bool) -> Result<Self, StudyError> {
        let plan = plan(study);
        let file = path.join(PLAN);
        let refuse = |found: &str, advice| {
            Err(StudyError::Folder { folder: path.to_owned(), found: found.to_owned(), advice })
        };
        if let Ok(there) = fs::read_to_string(&file) {
            if there != plan {
                return refuse(
                    "another study, another seed or another version of the program was begun in it",
                    "give another folder with --out",
                );
            }
            if !go_on {
                return refuse("this study was begun in it", "go on with --resume, or give another --out");
            }
        } else {
            let empty = fs::read_dir(path).map_or(true, |mut entries| {
                // Another worker may be making it at this moment.
                entries.all(|entry| entry.is_ok_and(|entry| go_on && is_ours(&entry.file_name())))
            });
            if !empty {
                return refuse("is there already, and holds something else", "give a new folder with --out");
            }
        }
        fs::create_dir_all(path.join(PARTS)).map_err(StudyError::at(path))?;
        write_whole(&file, plan.as_bytes()).map_err(StudyError::at(&file))?;
        Ok(Self { path: path.to_owned() })
    }

    /// The seed of the study that was begun in `path`.
    pub fn seed(path: &Path) -> Option<u64> {
        let text = fs::read_to_string(path.join(PLAN)).ok()?;
        serde_json::from_str::<Value>(&text).ok()?["seed"].as_u64()
    }

    /// Where it is.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The parts that are still to be done.
    pub fn to_do(&self, study: &Study) -> Vec<Part> {
        (0..study.parts())
            .map(|number| Part::of(&self.path, number))
            .filter(|part| !part.is_done(study))
            .collect()
    }

    /// Makes `study.csv` and all tables from the parts, which must all be done.
    pub fn finish(&self, study: &Study) -> Result<(Gathered, Tables), StudyError> {
        let failed = assemble(study, &self.path)?;
        let problems: Vec<Problem> = study.problems.iter().cloned().chain(failed).collect();
        let apart = study.apart();
        let is_apart = |subject: &str, session: u32| {
            apart.binary_search_by(|(s, n)| (s.as_str(), *n).cmp(&(subject, session))).is_ok()
        };
        let gathered = gather(&self.path.join("study.csv"), Origin::Assembled, is_apart, problems)?;
        let tables = Tables::of(&gathered);
        let about = json!({ "name": study.name, "seed": study.seed, "weighting": study.weighting, "units": study.units() });
        write(&self.path, &gathered, &tables, &about)?;
        Ok((gathered, tables))
    }
}

/// The tables of a table: of a `study.csv` that was made before, and perhaps changed by hand since. Written into `folder`.
pub fn tables_of(table: &Path, folder: &Path) -> Result<(Gathered, Tables), StudyError> {
    let gathered = gather(table, Origin::Foreign, |_, _| false, Vec::new())?;
    let tables = Tables::of(&gathered);
    if folder.join("study.json").exists() {
        return Err(StudyError::Folder {
            folder: folder.to_owned(),
            found: "holds the tables of a study".to_owned(),
            advice: "give another folder with --out",
        });
    }
    fs::create_dir_all(folder).map_err(StudyError::at(folder))?;
    write(folder, &gathered, &tables, &json!({}))?;
    Ok((gathered, tables))
}

/// What a folder may hold before its plan is seen in it.
fn is_ours(name: &OsStr) -> bool {
    name == PARTS || name == PLAN || name.to_string_lossy().starts_with(NEW)
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

fn write(folder: &Path, gathered: &Gathered, tables: &Tables, about: &Value) -> Result<(), StudyError> {
    for table in &tables.files {
        let path = folder.join(table.name);
        write_whole(&path, table.text.as_bytes()).map_err(StudyError::at(&path))?;
    }
    let told: Vec<String> = gathered.problems.iter().map(Problem::to_string).collect();
    let complete: Value = QUANTITIES
        .iter()
        .zip(&gathered.complete)
        .map(|(name, moments)| ((*name).to_owned(), json!(moments.count())))
        .collect::<serde_json::Map<_, _>>()
        .into();
    let results = json!({
        "format": RESULTS_FORMAT,
        "version": env!("CARGO_PKG_VERSION"),
        "study": about,
        "persons": gathered.persons,
        "sessions_each": gathered.sessions,
        "persons_with_all_conditions": complete,
        "velocities_rad_s": gathered.layout.velocities_rad_s,
        "torques_nm": gathered.layout.torques_nm,
        "problem_count": gathered.problem_count,
        "problems": told,
    });
    let path = folder.join("study.json");
    write_whole(&path, format!("{results:#}\n").as_bytes()).map_err(StudyError::at(&path))
}
