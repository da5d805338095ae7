//! The study file: `ramphold-study/1`.

use std::path::{Path, PathBuf};

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use super::error::StudyError;
use super::population::SubjectSpread;
use crate::consistency::SignalCheck;
use crate::fit::Weighting;
use crate::json_file;

/// Format and version of study files.
pub const STUDY_FORMAT: &str = "ramphold-study/1";

/// A study: its subjects, their protocol, and how the sessions are fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyFile {
    /// Location of this schema, for editors.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Format and version: `ramphold-study/1`.
    pub format: String,
    /// Name of the study.
    pub name: String,
    /// The subjects.
    #[serde(rename = "persons")]
    pub subjects: Subjects,
    /// Weighting of the residuals: by the noise measured in the holds, or all samples alike as in the paper.
    #[serde(default)]
    #[schemars(with = "WeightingSchema")]
    pub weighting: Weighting,
    /// The fit whose values are tested: that of the session as a whole, or of each trial on its own as in the paper.
    #[serde(default)]
    pub fit: StudyFit,
    /// Number of sessions in a part. A part is the smallest piece of work: an interrupted part is done again.
    #[serde(default = "default_units_per_part")]
    #[schemars(range(min = 1, max = 10_000))]
    pub units_per_part: u32,
}

/// The fit whose values a study tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum StudyFit {
    /// The fit of the session as a whole.
    #[default]
    Session,
    /// Each trial on its own: the method of the paper.
    Independent,
}

impl StudyFit {
    /// Name in the tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Session => "session",
            Self::Independent => "independent",
        }
    }
}

/// The names of [`Weighting`] in the file.
#[derive(JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "only its schema is used")]
enum WeightingSchema {
    MeasuredNoise,
    Plain,
}

fn default_units_per_part() -> u32 {
    8
}

/// The subjects of a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Subjects {
    /// Virtual subjects, drawn around an average subject.
    Virtual(Box<VirtualSubjects>),
    /// Subjects who were measured.
    Measured(MeasuredSessions),
}

/// Virtual subjects and their rig.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VirtualSubjects {
    /// Number of subjects.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub count: u32,
    /// The protocol: a file, relative to the folder of this file. Orders of the kind `williams` are counterbalanced over the sessions
    /// of the study.
    pub protocol: PathBuf,
    /// Number of sessions of each subject.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 100))]
    pub sessions: u32,
    /// The average subject: a file, relative to the folder of this file (default: the program's average subject).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<PathBuf>,
    /// The virtual rig: a file, relative to the folder of this file (default: the program's virtual rig).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<PathBuf>,
    /// Spread between subjects.
    pub spread: SubjectSpread,
    /// Spread between sessions of a subject.
    #[serde(default)]
    pub between_sessions: SubjectSpread,
}

fn one() -> u32 {
    1
}

/// Measured sessions.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredSessions {
    /// Session folders, or folders of session folders, relative to the folder of this file.
    #[schemars(length(min = 1))]
    pub folders: Vec<PathBuf>,
    /// Whether several sessions of one subject are repeated measurements, in the order of the list. If not, only the first is used.
    #[serde(default)]
    pub repeated: bool,
    /// Checks of the signals against the sessions' tables that may fail, by the names of `ramphold fit --accept`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub accept: Vec<SignalCheck>,
}

/// What the file should be, for messages.
const STUDY_FILE: &str = "the file of a study (see ramphold schema study)";

/// The JSON schema of study files, as text.
pub fn schema_text() -> String {
    format!("{:#}\n", schema_for!(StudyFile).to_value())
}

impl StudyFile {
    /// Reads a study file. Returns the study and the text of the file.
    pub fn read(file: &Path) -> Result<(Self, String), StudyError> {
        let text = json_file::read_text(file, STUDY_FILE)?;
        Ok((Self::parse(&text, file)?, text))
    }

    /// Parses and checks the `text` of a study file; `file` is named in error messages.
    pub fn parse(text: &str, file: &Path) -> Result<Self, StudyError> {
        let study: Self = json_file::parse(text, file, STUDY_FILE)?;
        study.check(file)?;
        Ok(study)
    }

    fn check(&self, file: &Path) -> Result<(), StudyError> {
        let refuse = |field: &str, found: String, expected| {
            Err(StudyError::Value { file: file.to_owned(), field: field.to_owned(), found, expected })
        };
        if self.format != STUDY_FORMAT {
            return refuse("format", self.format.clone(), STUDY_FORMAT);
        }
        if !(1..=10_000).contains(&self.units_per_part) {
            return refuse(
                "units_per_part",
                self.units_per_part.to_string(),
                "a whole number from 1 to 10000",
            );
        }
        match &self.subjects {
            Subjects::Virtual(persons) => {
                if !(1..=10_000_000).contains(&persons.count) {
                    let expected = "a whole number from 1 to 10000000";
                    return refuse("persons.count", persons.count.to_string(), expected);
                }
                if !(1..=100).contains(&persons.sessions) {
                    return refuse(
                        "persons.sessions",
                        persons.sessions.to_string(),
                        "a whole number from 1 to 100",
                    );
                }
                for (name, spread) in
                    [("spread", &persons.spread), ("between_sessions", &persons.between_sessions)]
                {
                    if let Some((field, found)) = spread.first_invalid() {
                        let field = format!("persons.{name}.{field}");
                        return refuse(
                            &field,
                            found.to_string(),
                            "a number from 0 up; at most 1 for a level",
                        );
                    }
                }
                Ok(())
            }
            Subjects::Measured(persons) if persons.folders.is_empty() => {
                refuse("persons.folders", "an empty list".to_owned(), "at least one folder")
            }
            Subjects::Measured(_) => Ok(()),
        }
    }
}
