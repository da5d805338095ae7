//! The file of a study.

use std::fs;
use std::path::{Path, PathBuf};

use schemars::{JsonSchema, schema_for};
use serde::{Deserialize, Serialize};

use super::error::StudyError;
use super::population::PersonSpread;
use crate::fit::Weighting;

/// Format and version of study files.
pub const FORMAT: &str = "ramphold-study/1";

/// Persons, what they are put through, and how their sessions are fitted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StudyFile {
    /// Where an editor finds this schema.
    #[serde(rename = "$schema", default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// Format and version: `ramphold-study/1`.
    pub format: String,
    /// What it is called.
    pub name: String,
    /// Who takes part.
    pub persons: Persons,
    /// How residuals are weighed: by the noise of the holds, or all alike as in the paper.
    #[serde(default)]
    #[schemars(with = "WeightingWords")]
    pub weighting: Weighting,
    /// Sessions in a part, the piece of work that is done or not done.
    #[serde(default = "default_units_per_part")]
    #[schemars(range(min = 1, max = 10_000))]
    pub units_per_part: u32,
}

/// The words of [`Weighting`].
#[derive(JsonSchema)]
#[serde(rename_all = "snake_case")]
#[allow(dead_code, reason = "only its schema is used")]
enum WeightingWords {
    MeasuredNoise,
    Plain,
}

fn default_units_per_part() -> u32 {
    8
}

/// Who takes part in a study.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Persons {
    /// Virtual persons, drawn around an average one.
    Virtual(Box<VirtualPersons>),
    /// Persons who were measured.
    Measured(Measured),
}

/// Virtual persons and the rig they sit at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct VirtualPersons {
    /// How many.
    #[schemars(range(min = 1, max = 10_000_000))]
    pub count: u32,
    /// The protocol they go through: a file, from the folder of this one. Orders of the kind `williams` are counterbalanced over
    /// the sessions of the study.
    pub protocol: PathBuf,
    /// Sessions of each person.
    #[serde(default = "one")]
    #[schemars(range(min = 1, max = 100))]
    pub sessions: u32,
    /// The average person: a file, from the folder of this one (the average one of the program if not given).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub person: Option<PathBuf>,
    /// The rig: a file, from the folder of this one (the virtual wrist as it comes if not given).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rig: Option<PathBuf>,
    /// How persons differ from each other.
    pub spread: PersonSpread,
    /// How a person differs from session to session.
    #[serde(default)]
    pub between_sessions: PersonSpread,
}

fn one() -> u32 {
    1
}

/// Sessions that were measured.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Session folders, or folders of session folders, from the folder of this file.
    #[schemars(length(min = 1))]
    pub folders: Vec<PathBuf>,
    /// Several sessions of one person are repeated measurements, in the order in which they come here.
    #[serde(default)]
    pub repeated: bool,
}

/// The JSON schema of study files, as text.
pub fn schema_text() -> String {
    format!("{:#}\n", schema_for!(StudyFile).to_value())
}

impl StudyFile {
    /// Reads a study file; also gives its text.
    pub fn read(file: &Path) -> Result<(Self, String), StudyError> {
        let text = fs::read_to_string(file)
            .map_err(|source| StudyError::Unreadable { file: file.to_owned(), source })?;
        Ok((Self::parse(&text, file)?, text))
    }

    /// The study that `text` describes; `file` is its name for messages.
    pub fn parse(text: &str, file: &Path) -> Result<Self, StudyError> {
        let wrong = |field: String, error: &serde_json::Error| StudyError::Json {
            file: file.to_owned(),
            line: error.line(),
            field,
            message: error.to_string(),
        };
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let study: Self = serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|error| wrong(error.path().to_string(), error.inner()))?;
        deserializer.end().map_err(|error| wrong(".".to_owned(), &error))?;
        study.check(file)?;
        Ok(study)
    }

    fn check(&self, file: &Path) -> Result<(), StudyError> {
        let refuse = |field: &str, found: String, expected| {
            Err(StudyError::Value { file: file.to_owned(), field: field.to_owned(), found, expected })
        };
        if self.format != FORMAT {
            return refuse("format", self.format.clone(), FORMAT);
        }
        if !(1..=10_000).contains(&self.units_per_part) {
            return refuse(
                "units_per_part",
                self.units_per_part.to_string(),
                "a whole number from 1 to 10000",
            );
        }
        match &self.persons {
            Persons::Virtual(persons) => {
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
                    if let Some((field, found)) = spread.first_bad() {
                        let field = format!("persons.{name}.{field}");
                        return refuse(
                            &field,
                            found.to_string(),
                            "a number from 0 up, at most 1 for a level",
                        );
                    }
                }
                Ok(())
            }
            Persons::Measured(persons) if persons.folders.is_empty() => {
                refuse("persons.folders", "an empty list".to_owned(), "at least one folder")
            }
            Persons::Measured(_) => Ok(()),
        }
    }
}
