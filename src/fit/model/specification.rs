//! A fit model is data: which mechanisms, and how each parameter goes with condition, repetition, velocity and torque.

use serde::{Deserialize, Serialize};

use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::{CATALOGUE, MechanismKind};

/// The version of the model format that this program reads and writes.
pub const FORMAT: &str = "ramphold-model/1";

/// Over which trials a parameter has one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// It keeps the value given.
    Fixed,
    /// Each trial its own.
    Trial,
    /// Each condition its own, shared by its repetitions.
    Condition,
    /// Each repetition its own, shared by its conditions.
    Repetition,
    /// One for the whole session.
    Session,
}

/// What a law is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LawTerm {
    /// A constant.
    One,
    /// Proportional to the ramp velocity.
    Velocity,
    /// Proportional to the target torque.
    Torque,
    /// Proportional to their product.
    VelocityTorque,
}

impl LawTerm {
    /// Its factor for a trial.
    pub fn factor(self, velocity_rad_s: f64, torque_nm: f64) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Velocity => velocity_rad_s.abs(),
            Self::Torque => torque_nm,
            Self::VelocityTorque => velocity_rad_s.abs() * torque_nm,
        }
    }
}

/// How one parameter is treated.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    /// Over which trials it has one value; for a law, over which its coefficients do.
    pub scope: Scope,
    /// The terms of a law over velocity and torque; empty for none. `["one", "velocity"]` for the elastic limit is
    /// x_e = x_0 + v x_t.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub law: Vec<LawTerm>,
    /// Its value if fixed, else where the fit starts (found from the data if absent).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Least value allowed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Greatest value allowed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

impl ParameterSpec {
    /// Free over `scope`.
    pub fn free(scope: Scope) -> Self {
        Self { scope, law: Vec::new(), value: None, low: None, high: None }
    }

    /// Held at `value`.
    pub fn fixed(value: f64) -> Self {
        Self { value: Some(value), ..Self::free(Scope::Fixed) }
    }
}

/// A mechanism switched on.
#[derive(Debug, Clone, PartialEq)]
pub struct AddedMechanism {
    /// Which.
    pub kind: MechanismKind,
    /// How its parameters are treated, in its own order.
    pub parameters: Vec<ParameterSpec>,
}

/// A fit model.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// The six base parameters, in the order of [`BASE_PARAMETERS`].
    pub base: [ParameterSpec; 6],
    /// What is added to Eq. 1-7.
    pub mechanisms: Vec<AddedMechanism>,
}

impl Model {
    /// The paper's: I_j shared by the conditions of a repetition, the other five free per trial (section 2.4).
    pub fn paper() -> Self {
        let free = || ParameterSpec::free(Scope::Trial);
        Self {
            base: [ParameterSpec::free(Scope::Repetition), free(), free(), free(), free(), free()],
            mechanisms: Vec::new(),
        }
    }

    /// This model with `kind` added, its parameters fitted once for the session from typical values.
    pub fn with(mut self, kind: MechanismKind) -> Self {
        let treat = |parameter: &crate::wrist::mechanisms::MechanismParameter| ParameterSpec {
            value: Some(parameter.typical),
            ..ParameterSpec::free(if parameter.fitted { Scope::Session } else { Scope::Fixed })
        };
        self.mechanisms
            .push(AddedMechanism { kind, parameters: kind.parameters().iter().map(treat).collect() });
        self
    }

    /// The mechanisms switched on, in order.
    pub fn kinds(&self) -> Vec<MechanismKind> {
        self.mechanisms.iter().map(|switched| switched.kind).collect()
    }

    /// Frequency of the sinusoid that is subtracted from the records before the fit, Hz, if the model has one.
    pub fn hum_hz(&self) -> Option<f64> {
        self.mechanisms.iter().find_map(|added| added.parameters[added.kind.subtracted_frequency()?].value)
    }

    /// Names of all parameters in the order of a trial's parameter vector; a mechanism's carry its id.
    pub fn parameter_names(&self) -> Vec<String> {
        let base = BASE_PARAMETERS.iter().map(|name| (*name).to_string());
        let added = self.mechanisms.iter().flat_map(|switched| {
            let id = switched.kind.id();
            switched.kind.parameters().iter().map(move |parameter| format!("{id}.{}", parameter.name))
        });
        base.chain(added).collect()
    }

    /// How all parameters are treated, in the order of a trial's parameter vector.
    pub fn treatments(&self) -> Vec<&ParameterSpec> {
        let added = self.mechanisms.iter().flat_map(|switched| &switched.parameters);
        self.base.iter().chain(added).collect()
    }
}

/// A mechanism as a model file writes it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MechanismFile {
    mechanism: String,
    #[serde(default)]
    parameters: std::collections::BTreeMap<String, ParameterFile>,
}

/// A mechanism's parameter: a number is its fixed value.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(untagged)]
enum ParameterFile {
    Value(f64),
    ParameterSpec(ParameterSpec),
}

/// A model as a file writes it.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct ModelFile {
    format: String,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    note: Option<String>,
    #[serde(default)]
    parameters: std::collections::BTreeMap<String, ParameterSpec>,
    #[serde(default)]
    mechanisms: Vec<MechanismFile>,
}

/// A model file that cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ModelError {
    /// Not JSON, or not of the expected form.
    #[error("{path}: {message}")]
    Form {
        /// Where in the file.
        path: String,
        /// What is wrong.
        message: String,
    },
    /// Another format or version.
    #[error("format: \"{found}\"; expected \"{FORMAT}\"")]
    Format {
        /// What the file says.
        found: String,
    },
    /// No such parameter.
    #[error("parameters.{name}: unknown; expected one of {expected}")]
    MechanismParameter {
        /// What the file says.
        name: String,
        /// What there is.
        expected: String,
    },
    /// No such mechanism.
    #[error("mechanisms[{index}].mechanism: \"{name}\" is not in the catalogue; expected one of {}", ids())]
    Mechanism {
        /// BlockIndex in the list.
        index: usize,
        /// What the file says.
        name: String,
    },
    /// A value that makes no sense.
    #[error("{path}: {message}")]
    Value {
        /// Where in the file.
        path: String,
        /// What is wrong and what was expected.
        message: String,
    },
}

fn ids() -> String {
    CATALOGUE.iter().map(|kind| kind.id()).collect::<Vec<_>>().join(", ")
}

impl Model {
    /// Reads a model file.
    ///
    /// # Errors
    /// If it is not JSON, has unknown fields, names no parameter or mechanism, or holds values outside their bounds.
    pub fn parse(text: &str) -> Result<Self, ModelError> {
        let mut deserializer = serde_json::Deserializer::from_str(text);
        let file: ModelFile = serde_path_to_error::deserialize(&mut deserializer)
            .map_err(|e| ModelError::Form { path: e.path().to_string(), message: e.inner().to_string() })?;
        deserializer
            .end()
            .map_err(|error| ModelError::Form { path: ".".to_owned(), message: error.to_string() })?;
        if file.format != FORMAT {
            return Err(ModelError::Format { found: file.format });
        }
        let mut model = Self::paper();
        for (name, treatment) in file.parameters {
            let Some(index) = BASE_PARAMETERS.iter().position(|known| *known == name) else {
                return Err(ModelError::MechanismParameter { name, expected: BASE_PARAMETERS.join(", ") });
            };
            check(&format!("parameters.{name}"), &treatment, (f64::NEG_INFINITY, f64::INFINITY))?;
            model.base[index] = treatment;
        }
        for (index, entry) in file.mechanisms.into_iter().enumerate() {
            let Some(kind) = CATALOGUE.iter().copied().find(|kind| kind.id() == entry.mechanism) else {
                return Err(ModelError::Mechanism { index, name: entry.mechanism });
            };
            if model.mechanisms.iter().any(|switched| switched.kind == kind) {
                return Err(ModelError::Value {
                    path: format!("mechanisms[{index}].mechanism"),
                    message: format!("\"{}\" is listed twice", kind.id()),
                });
            }
            model = model.with(kind);
            let added = model.mechanisms.len() - 1;
            for (name, given) in entry.parameters {
                let path = format!("mechanisms[{index}].parameters.{name}");
                let Some(place) = kind.parameters().iter().position(|parameter| parameter.name == name)
                else {
                    let known: Vec<_> = kind.parameters().iter().map(|parameter| parameter.name).collect();
                    return Err(ModelError::Value {
                        path,
                        message: format!("unknown; expected one of {}", known.join(", ")),
                    });
                };
                let treatment = match given {
                    ParameterFile::Value(value) => ParameterSpec::fixed(value),
                    ParameterFile::ParameterSpec(treatment) => treatment,
                };
                let bounds = (kind.parameters()[place].low, kind.parameters()[place].high);
                check(&path, &treatment, bounds)?;
                model.mechanisms[added].parameters[place] = treatment;
            }
        }
        Ok(model)
    }

    /// The model as a file, which [`Model::parse`] reads.
    pub fn to_json(&self, note: Option<&str>) -> String {
        let file = ModelFile {
            format: FORMAT.into(),
            note: note.map(Into::into),
            parameters: BASE_PARAMETERS
                .iter()
                .map(|n| (*n).to_string())
                .zip(self.base.iter().cloned())
                .collect(),
            mechanisms: self
                .mechanisms
                .iter()
                .map(|switched| MechanismFile {
                    mechanism: switched.kind.id().into(),
                    parameters: (switched
                        .kind
                        .parameters()
                        .iter()
                        .map(|parameter| parameter.name.to_string()))
                    .zip(switched.parameters.iter().cloned().map(ParameterFile::ParameterSpec))
                    .collect(),
                })
                .collect(),
        };
        serde_json::to_string_pretty(&file).expect("a model holds only strings and finite numbers") + "\n"
    }
}

fn check(path: &str, treatment: &ParameterSpec, bounds: (f64, f64)) -> Result<(), ModelError> {
    let wrong = |message: String| Err(ModelError::Value { path: path.into(), message });
    if treatment.scope == Scope::Fixed && treatment.value.is_none() {
        return wrong("a fixed parameter needs a value".into());
    }
    if treatment.scope == Scope::Fixed && !treatment.law.is_empty() {
        return wrong("a fixed parameter has no law; give its scope as \"session\" or \"repetition\"".into());
    }
    let (low, high) = (treatment.low.unwrap_or(bounds.0), treatment.high.unwrap_or(bounds.1));
    if low >= high {
        return wrong(format!("low {low} is not below high {high}"));
    }
    match treatment.value {
        Some(value) if treatment.law.is_empty() && !(low..=high).contains(&value) => {
            wrong(format!("value {value} is outside {low} to {high}"))
        }
        _ => Ok(()),
    }
}
