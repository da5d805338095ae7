//! Specification of a fit model: its mechanisms, and how each parameter varies over the trials of a session.

use std::ops::Range;

use serde::{Deserialize, Serialize};

use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::{MechanismKind, MechanismParameter};

/// The trials over which a parameter has one value.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Scope {
    /// The parameter is not estimated; it keeps the value given.
    Fixed,
    /// One value per trial.
    Trial,
    /// One value per condition, shared by the repetitions.
    Condition,
    /// One value per repetition, shared by the conditions.
    Repetition,
    /// One value for the whole session.
    Session,
}

/// Term of a law that gives a parameter as a linear combination over ramp velocity and target torque.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum LawTerm {
    /// The constant 1.
    One,
    /// The absolute ramp velocity, rad/s.
    Velocity,
    /// The target torque, N m.
    Torque,
    /// The product of absolute ramp velocity and target torque, N m rad/s.
    VelocityTorque,
}

impl LawTerm {
    /// Value of the term in a trial of ramp velocity `velocity_rad_s` and target torque `torque_nm`.
    pub fn factor(self, velocity_rad_s: f64, torque_nm: f64) -> f64 {
        match self {
            Self::One => 1.0,
            Self::Velocity => velocity_rad_s.abs(),
            Self::Torque => torque_nm,
            Self::VelocityTorque => velocity_rad_s.abs() * torque_nm,
        }
    }
}

/// Specification of one parameter: its scope, law, value and bounds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterSpec {
    /// The trials over which the parameter has one value; for a law, over which its coefficients have one value.
    pub scope: Scope,
    /// The terms of a law over velocity and torque; empty if the parameter has no law. `["one", "velocity"]` for the elastic
    /// limit is x_e = x_0 + v x_t.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub law: Vec<LawTerm>,
    /// The value of a fixed parameter, otherwise the starting value; if absent, the starting value comes from the data.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// Lower bound; if absent, the fit chooses one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// Upper bound; if absent, the fit chooses one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
}

impl ParameterSpec {
    /// A parameter that is estimated, with one value over `scope`.
    pub fn free(scope: Scope) -> Self {
        Self { scope, law: Vec::new(), value: None, low: None, high: None }
    }

    /// A parameter that is fixed at `value`.
    pub fn fixed(value: f64) -> Self {
        Self { value: Some(value), ..Self::free(Scope::Fixed) }
    }
}

/// A mechanism of the catalogue that is part of a fit model.
#[derive(Debug, Clone, PartialEq)]
pub struct AddedMechanism {
    /// The mechanism.
    pub kind: MechanismKind,
    /// Specifications of its parameters, in the order of the catalogue.
    pub parameters: Vec<ParameterSpec>,
}

/// A fit model: the base model, Eq. 1-7 of the paper, and mechanisms added to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Model {
    /// Specifications of the six base parameters, in the order of [`BASE_PARAMETERS`].
    pub base: [ParameterSpec; 6],
    /// The mechanisms added, in the order in which their parameters follow the base parameters.
    pub mechanisms: Vec<AddedMechanism>,
}

impl Default for Model {
    /// The paper's model.
    fn default() -> Self {
        Self::paper()
    }
}

impl Model {
    /// The paper's model: I_j shared by the conditions of a repetition, the other five parameters free in each trial (section
    /// 2.4).
    pub fn paper() -> Self {
        let free = || ParameterSpec::free(Scope::Trial);
        Self {
            base: [ParameterSpec::free(Scope::Repetition), free(), free(), free(), free(), free()],
            mechanisms: Vec::new(),
        }
    }

    /// This model with the mechanism `kind` added; its parameters have one value for the session and start at typical values.
    pub fn with(mut self, kind: MechanismKind) -> Self {
        let specify = |parameter: &MechanismParameter| ParameterSpec {
            value: Some(parameter.typical),
            ..ParameterSpec::free(if parameter.fitted { Scope::Session } else { Scope::Fixed })
        };
        let parameters = kind.parameters().iter().map(specify).collect();
        self.mechanisms.push(AddedMechanism { kind, parameters });
        self
    }

    /// The mechanisms of the model, in order.
    pub fn kinds(&self) -> Vec<MechanismKind> {
        self.mechanisms.iter().map(|added| added.kind).collect()
    }

    /// Frequency of the sinusoid that is subtracted from the records before the fit, Hz, if the model has one.
    pub fn hum_hz(&self) -> Option<f64> {
        self.mechanisms.iter().find_map(|added| added.parameters[added.kind.subtracted_frequency()?].value)
    }

    /// Names of all parameters in the order of a trial's parameter vector; those of a mechanism begin with its id and a dot.
    pub fn parameter_names(&self) -> Vec<String> {
        let base = BASE_PARAMETERS.iter().map(|name| (*name).to_string());
        let added = self.mechanisms.iter().flat_map(|added| {
            let id = added.kind.id();
            added.kind.parameters().iter().map(move |parameter| format!("{id}.{}", parameter.name))
        });
        base.chain(added).collect()
    }

    /// Specifications of all parameters in the order of a trial's parameter vector.
    pub fn parameter_specs(&self) -> Vec<&ParameterSpec> {
        let added = self.mechanisms.iter().flat_map(|added| &added.parameters);
        self.base.iter().chain(added).collect()
    }

    /// For each mechanism of the model, the range of its parameters in a trial's parameter vector.
    pub fn mechanism_ranges(&self) -> Vec<Range<usize>> {
        mechanism_ranges(&self.kinds())
    }
}

/// For each of `kinds`, the range of its parameters in the parameter vector of a trial of the model with these mechanisms.
pub fn mechanism_ranges(kinds: &[MechanismKind]) -> Vec<Range<usize>> {
    let mut first = BASE_PARAMETERS.len();
    kinds
        .iter()
        .map(|kind| {
            let range = first..first + kind.parameter_count();
            first = range.end;
            range
        })
        .collect()
}
