//! The model file: reading a fit model from JSON and writing it.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

use super::specification::{Model, ParameterSpec, Scope};
use crate::json_file;
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::{CATALOGUE, MechanismKind};

/// Version of the model format that this program reads and writes.
pub const MODEL_FORMAT: &str = "ramphold-model/1";

/// A mechanism in the model file.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MechanismFile {
    mechanism: String,
    #[serde(default, deserialize_with = "json_file::unique_names")]
    parameters: BTreeMap<String, ParameterFile>,
}

/// A parameter of a mechanism in the model file: a number fixes the parameter at that value.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(
    untagged,
    expecting = "expected a number, which fixes the parameter, or an object with scope, law, value, low and high"
)]
enum ParameterFile {
    Value(f64),
    Spec(ParameterSpec),
}

/// The whole model file.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    format: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    note: Option<String>,
    #[serde(default, deserialize_with = "json_file::unique_names")]
    parameters: BTreeMap<String, ParameterSpec>,
    #[serde(default)]
    mechanisms: Vec<MechanismFile>,
}

/// Reason why a model file cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// The file is not JSON, or a field is missing, unknown or of the wrong type.
    #[error("{path}: {message}")]
    Form {
        /// Path of the field in the file.
        path: String,
        /// What is wrong with the field.
        message: String,
    },
    /// The file has another format or version.
    #[error("format: \"{found}\"; expected \"{MODEL_FORMAT}\"")]
    Format {
        /// The format that the file names.
        found: String,
    },
    /// The base model has no parameter of this name.
    #[error("parameters.{name}: unknown; expected one of {expected}")]
    Parameter {
        /// The name in the file.
        name: String,
        /// The names that the base model has.
        expected: String,
    },
    /// The catalogue has no mechanism of this id.
    #[error(
        "mechanisms[{index}].mechanism: \"{name}\" is not in the catalogue; expected one of {}",
        catalogue_ids()
    )]
    Mechanism {
        /// Position in the list, from 0.
        index: usize,
        /// The id in the file.
        name: String,
    },
    /// A value contradicts its bounds or its scope.
    #[error("{path}: {message}")]
    Value {
        /// Path of the field in the file.
        path: String,
        /// What is wrong, and what was expected.
        message: String,
    },
}

/// Ids of all mechanisms of the catalogue, separated by commas.
fn catalogue_ids() -> String {
    CATALOGUE.iter().map(|kind| kind.id()).collect::<Vec<_>>().join(", ")
}

impl Model {
    /// Reads the text of a model file.
    ///
    /// # Errors
    /// If the file is not JSON, has an unknown field, names an unknown parameter or mechanism, or has a value outside its bounds.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        let file: ModelFile =
            json_file::parse(text, Path::new("model"), "a model file").map_err(|error| {
                let (path, message) = error.field_and_message();
                ModelError::Form { path, message }
            })?;
        if file.format != MODEL_FORMAT {
            return Err(ModelError::Format { found: file.format });
        }
        let mut model = Self::paper();
        for (name, spec) in file.parameters {
            let Some(index) = BASE_PARAMETERS.iter().position(|known| *known == name) else {
                return Err(ModelError::Parameter { name, expected: BASE_PARAMETERS.join(", ") });
            };
            let path = format!("parameters.{name}");
            check(&path, &spec, (f64::NEG_INFINITY, f64::INFINITY))?;
            check_base(&path, &name, &spec)?;
            model.base[index] = spec;
        }
        for (index, entry) in file.mechanisms.into_iter().enumerate() {
            let Some(kind) = MechanismKind::from_id(&entry.mechanism) else {
                return Err(ModelError::Mechanism { index, name: entry.mechanism });
            };
            if model.mechanisms.iter().any(|added| added.kind == kind) {
                return Err(ModelError::Value {
                    path: format!("mechanisms[{index}].mechanism"),
                    message: format!("\"{}\" is listed twice", kind.id()),
                });
            }
            model = model.with(kind);
            let added = model.mechanisms.len() - 1;
            for (name, given) in entry.parameters {
                let path = format!("mechanisms[{index}].parameters.{name}");
                let Some(position) = kind.parameters().iter().position(|parameter| parameter.name == name)
                else {
                    let known: Vec<_> = kind.parameters().iter().map(|parameter| parameter.name).collect();
                    return Err(ModelError::Value {
                        path,
                        message: format!("unknown; expected one of {}", known.join(", ")),
                    });
                };
                let spec = match given {
                    ParameterFile::Value(value) => ParameterSpec::fixed(value),
                    ParameterFile::Spec(spec) => spec,
                };
                let bounds = (kind.parameters()[position].low, kind.parameters()[position].high);
                check(&path, &spec, bounds)?;
                model.mechanisms[added].parameters[position] = spec;
            }
        }
        Ok(model)
    }

    /// The model file as a JSON value, as results keep it.
    pub fn json(&self) -> serde_json::Value {
        serde_json::from_str(&self.to_json(None)).unwrap_or_default()
    }

    /// The text of a model file, which [`Model::parse`] reads; `note` is stored with the model.
    pub fn to_json(&self, note: Option<&str>) -> String {
        let file = ModelFile {
            format: MODEL_FORMAT.into(),
            note: note.map(Into::into),
            parameters: BASE_PARAMETERS
                .iter()
                .map(|n| (*n).to_string())
                .zip(self.base.iter().cloned())
                .collect(),
            mechanisms: self
                .mechanisms
                .iter()
                .map(|added| MechanismFile {
                    mechanism: added.kind.id().into(),
                    parameters: (added.kind.parameters().iter().map(|parameter| parameter.name.to_string()))
                        .zip(added.parameters.iter().cloned().map(ParameterFile::Spec))
                        .collect(),
                })
                .collect(),
        };
        json_file::pretty(&file)
    }
}

/// A stretch by half a turn or more is none of a muscle that a joint is turned by, rad.
const LONGEST_STRETCH_RAD: f64 = std::f64::consts::PI;

/// Refuses a value, fixed or to start from, that the base parameter `name` cannot have. Inertia, damping, stiffness and elastic limit are
/// above 0, and so is what bounds them from above. A law has coefficients of either sign.
fn check_base(path: &str, name: &str, spec: &ParameterSpec) -> Result<(), ModelError> {
    if !spec.law.is_empty() {
        return Ok(());
    }
    let (below, expected) = if name == "x_e_rad" {
        (LONGEST_STRETCH_RAD, "above 0 and below half a turn, 3.14159 rad; 5 degrees are 0.087 rad")
    } else {
        (f64::INFINITY, "above 0")
    };
    let given = [("value", spec.value, below), ("high", spec.high, f64::INFINITY)];
    let wrong = given.into_iter().find_map(|(field, given, below)| {
        given.filter(|given| !(*given > 0.0 && *given < below)).map(|given| (field, given))
    });
    match wrong {
        Some((field, given)) => Err(ModelError::Value {
            path: path.into(),
            message: format!("{field} {given} is impossible; expected a number {expected}"),
        }),
        None => Ok(()),
    }
}

/// Refuses a specification that contradicts itself or leaves `bounds`; `path` names its field in the file.
fn check(path: &str, spec: &ParameterSpec, bounds: (f64, f64)) -> Result<(), ModelError> {
    let wrong = |message: String| Err(ModelError::Value { path: path.into(), message });
    if spec.scope == Scope::Fixed && spec.value.is_none() {
        return wrong("a fixed parameter needs a value".into());
    }
    if spec.scope == Scope::Fixed && !spec.law.is_empty() {
        return wrong("a fixed parameter has no law; give its scope as \"session\" or \"repetition\"".into());
    }
    if let Some(term) =
        spec.law.iter().enumerate().find_map(|(at, term)| spec.law[..at].contains(term).then_some(term))
    {
        return wrong(format!("the law has the term {term:?} twice; expected each term once"));
    }
    let (low, high) = (spec.low.unwrap_or(bounds.0), spec.high.unwrap_or(bounds.1));
    if low >= high {
        return wrong(format!("low {low} is not below high {high}"));
    }
    match spec.value {
        Some(value) if spec.law.is_empty() && !(low..=high).contains(&value) => {
            wrong(format!("value {value} is outside {low} to {high}"))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn refused(parameters: &str) -> String {
        let text = format!(r#"{{ "format": "ramphold-model/1", "parameters": {{ {parameters} }} }}"#);
        Model::parse(&text).unwrap_err().to_string()
    }

    #[test]
    fn a_value_that_no_wrist_has_is_refused_with_what_is_expected() {
        for value in ["0", "-900", "-1e-9"] {
            for scope in ["fixed", "trial", "session"] {
                let told =
                    refused(&format!(r#""k_srs_nm_per_rad": {{ "scope": "{scope}", "value": {value} }}"#));
                assert!(told.starts_with("parameters.k_srs_nm_per_rad: value -") || value == "0", "{told}");
                assert!(told.contains("expected a number above 0"), "{told}");
            }
        }
        let told = refused(r#""x_e_rad": { "scope": "fixed", "value": 5 }"#);
        assert!(told.contains("value 5 is impossible") && told.contains("below half a turn"), "{told}");
        let told = refused(r#""i_j_kg_m2": { "scope": "session", "high": -1 }"#);
        assert!(told.contains("high -1 is impossible"), "{told}");
        let text = r#"{ "format": "ramphold-model/1", "parameters": {
            "x_e_rad": { "scope": "session", "law": ["one", "velocity"], "value": -0.01 },
            "k_h_nm_per_rad": { "scope": "fixed", "value": 300 } } }"#;
        assert_eq!(Model::parse(text).unwrap().base[2].value, Some(300.0));
    }

    #[test]
    fn a_name_that_is_written_twice_is_refused() {
        let one = r#""k_h_nm_per_rad": { "scope": "fixed", "value": 300 }"#;
        let told = refused(&format!(r#"{one}, "k_h_nm_per_rad": {{ "scope": "trial" }}"#));
        assert!(told.contains("\"k_h_nm_per_rad\" is written twice"), "{told}");
        let kind = CATALOGUE[0];
        let name = kind.parameters()[0].name;
        let text = format!(
            r#"{{ "format": "ramphold-model/1", "mechanisms": [
                {{ "mechanism": "{}", "parameters": {{ "{name}": 1, "{name}": 2 }} }} ] }}"#,
            kind.id()
        );
        let told = Model::parse(&text).unwrap_err().to_string();
        assert!(told.contains("is written twice"), "{told}");
    }

    #[test]
    fn a_parameter_that_is_neither_a_number_nor_an_object_is_refused_with_what_it_may_be() {
        let kind = CATALOGUE[0];
        let text = format!(
            r#"{{ "format": "ramphold-model/1", "mechanisms": [
                {{ "mechanism": "{}", "parameters": {{ "{}": "NaN" }} }} ] }}"#,
            kind.id(),
            kind.parameters()[0].name
        );
        let told = Model::parse(&text).unwrap_err().to_string();
        assert!(
            told.contains("expected a number, which fixes the parameter, or an object with scope"),
            "{told}"
        );
    }
}
