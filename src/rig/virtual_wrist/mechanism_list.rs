//! MechanismList of the catalogue that are at work in a virtual person or rig.

use std::collections::BTreeMap;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::wrist::mechanisms::{CATALOGUE, MechanismClass, MechanismKind};

/// A list of mechanisms and the values of their parameters, as written in a file:
/// `[{ "mechanism": "joint_damping", "parameters": { "b_j_nm_s_per_rad": 0.05 } }]`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(try_from = "Vec<Written>", into = "Vec<Written>")]
#[schemars(with = "Vec<Written>")]
pub struct MechanismList {
    /// The mechanisms, in order.
    pub kinds: Vec<MechanismKind>,
    /// Their parameters, one mechanism after the other.
    pub parameters: Vec<f64>,
}

impl MechanismList {
    /// The mechanisms of `self`, followed by those of `other`.
    pub fn and(&self, other: &Self) -> Self {
        Self {
            kinds: [&self.kinds[..], &other.kinds].concat(),
            parameters: [&self.parameters[..], &other.parameters].concat(),
        }
    }

    /// The mechanisms of some classes alone.
    pub fn of_classes(&self, classes: &[MechanismClass]) -> Self {
        let mut first = 0;
        let own = self.kinds.iter().filter_map(|kind| {
            let parameters = first..first + kind.parameter_count();
            first = parameters.end;
            classes.contains(&kind.class()).then(|| (*kind, self.parameters[parameters].to_vec()))
        });
        own.collect()
    }

    /// Values that are outside of what the catalogue has for the parameter, for the operator: a latency in ms is one.
    pub fn outside_catalogue(&self) -> Vec<String> {
        let parameters = self.kinds.iter().flat_map(|kind| {
            kind.parameters()
                .iter()
                .map(move |parameter| (kind.id(), parameter.name, parameter.low, parameter.high))
        });
        parameters
            .zip(&self.parameters)
            .filter(|((_, _, low, high), value)| !(*low..=*high).contains(*value))
            .map(|((id, name, low, high), value)| {
                format!("mechanism {id}: {name} is {value}, outside of {low} to {high}, where diagnose looks for it: is its unit right?")
            })
            .collect()
    }

    /// The list with every effect that begins before the onset moved to the onset: the subject does not know of the ramp before.
    pub fn starting_at_onset(mut self) -> Self {
        let mut rest = self.parameters.as_mut_slice();
        for kind in &self.kinds {
            let (own, others) = rest.split_at_mut(kind.parameter_count());
            kind.start_at_onset(own);
            rest = others;
        }
        self
    }
}

impl FromIterator<(MechanismKind, Vec<f64>)> for MechanismList {
    fn from_iter<I: IntoIterator<Item = (MechanismKind, Vec<f64>)>>(list: I) -> Self {
        let mut mechanisms = Self::default();
        for (kind, parameters) in list {
            mechanisms.kinds.push(kind);
            mechanisms.parameters.extend(parameters);
        }
        mechanisms
    }
}

/// One mechanism in a file.
#[derive(Debug, Clone, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Written {
    /// Id in the catalogue.
    mechanism: String,
    /// Values of its parameters, every one by its name; the order of a low-pass may be left out, and is 1 then.
    parameters: BTreeMap<String, f64>,
}

/// Why a list of mechanisms in a file is refused.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum MechanismListError {
    /// No such id.
    #[error("mechanism {found:?} is not in the catalogue; expected one of {known}")]
    Id {
        /// The id given.
        found: String,
        /// Those there are.
        known: String,
    },
    /// A mechanism is in the list twice.
    #[error("mechanism {mechanism} is in the list twice; expected each mechanism once")]
    Twice {
        /// The mechanism.
        mechanism: String,
    },
    /// A parameter is missing, too much, or not a number.
    #[error("mechanism {mechanism}: parameters {found:?}; expected finite numbers for {expected:?}")]
    Parameters {
        /// The mechanism.
        mechanism: String,
        /// The names given.
        found: Vec<String>,
        /// Its own.
        expected: Vec<String>,
    },
}

impl TryFrom<Vec<Written>> for MechanismList {
    type Error = MechanismListError;

    fn try_from(list: Vec<Written>) -> Result<Self, MechanismListError> {
        let mut mechanisms = Self::default();
        for Written { mechanism, parameters } in list {
            let Some(kind) = MechanismKind::from_id(&mechanism) else {
                let known: Vec<&str> = CATALOGUE.iter().map(|kind| kind.id()).collect();
                return Err(MechanismListError::Id { found: mechanism, known: known.join(", ") });
            };
            let mut values: Vec<f64> = kind
                .parameters()
                .iter()
                .filter_map(|parameter| parameters.get(parameter.name).copied())
                .collect();
            let are_all_known = values.len() == parameters.len();
            let last = kind.parameters().last().filter(|last| !parameters.contains_key(last.name));
            values.extend(last.and_then(|_| kind.laws().first()));
            if !are_all_known
                || values.len() != kind.parameters().len()
                || values.iter().any(|value| !value.is_finite())
            {
                return Err(MechanismListError::Parameters {
                    mechanism,
                    found: parameters.into_keys().collect(),
                    expected: kind.parameters().iter().map(|parameter| parameter.name.to_owned()).collect(),
                });
            }
            if mechanisms.kinds.contains(&kind) {
                return Err(MechanismListError::Twice { mechanism });
            }
            mechanisms.kinds.push(kind);
            mechanisms.parameters.extend(values);
        }
        Ok(mechanisms)
    }
}

impl From<MechanismList> for Vec<Written> {
    fn from(mechanisms: MechanismList) -> Self {
        let mut values = mechanisms.parameters.into_iter();
        mechanisms
            .kinds
            .iter()
            .map(|kind| Written {
                mechanism: kind.id().to_owned(),
                parameters: kind
                    .parameters()
                    .iter()
                    .zip(values.by_ref())
                    .map(|(parameter, value)| (parameter.name.to_owned(), value))
                    .collect(),
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_list_of_mechanisms_survives_writing_and_reading() {
        let text = r#"[{"mechanism":"fatigue","parameters":{"fraction":0.05}},
            {"mechanism":"torque_drift","parameters":{"slope_nm_per_s":1.0,"start_s":0.005}}]"#;
        let read: MechanismList = serde_json::from_str(text).unwrap();
        assert_eq!(read.parameters, [0.05, 1.0, 0.005]);
        let again: MechanismList = serde_json::from_str(&serde_json::to_string(&read).unwrap()).unwrap();
        assert_eq!(again, read);
    }

    #[test]
    fn a_low_pass_without_an_order_is_of_first_order() {
        let list = |parameters: &str| {
            let text = format!(r#"[{{"mechanism":"torque_lag","parameters":{parameters}}}]"#);
            serde_json::from_str::<MechanismList>(&text)
        };
        assert_eq!(list(r#"{"cutoff_hz":150}"#).unwrap().parameters, [150.0, 1.0]);
        assert_eq!(list(r#"{"cutoff_hz":150,"order":2}"#).unwrap().parameters, [150.0, 2.0]);
        for wrong in [r#"{"order":2}"#, r#"{"cutoff_hz":150,"rank":2}"#, "{}"] {
            assert!(list(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_value_that_no_diagnosis_would_find_is_told_with_the_bounds() {
        let told = |text: &str| serde_json::from_str::<MechanismList>(text).unwrap().outside_catalogue();
        assert!(told(r#"[{"mechanism":"fatigue","parameters":{"fraction":0.05}}]"#).is_empty());
        let late = told(
            r#"[{"mechanism":"fatigue","parameters":{"fraction":0.05}},
            {"mechanism":"torque_drift","parameters":{"slope_nm_per_s":1.0,"start_s":5}}]"#,
        );
        assert_eq!(late.len(), 1);
        assert!(late[0].starts_with("mechanism torque_drift: start_s is 5, outside of"), "{late:?}");
    }

    #[test]
    fn an_unknown_mechanism_or_parameter_is_refused_with_what_there_is() {
        let refuse = |text: &str| serde_json::from_str::<MechanismList>(text).unwrap_err().to_string();
        let message = refuse(r#"[{"mechanism":"ghost","parameters":{}}]"#);
        assert!(message.contains("\"ghost\"") && message.contains("joint_damping"), "{message}");
        for parameters in ["{}", r#"{"fraction":1.0,"more":2.0}"#, r#"{"part":1.0}"#] {
            let message = refuse(&format!(r#"[{{"mechanism":"fatigue","parameters":{parameters}}}]"#));
            assert!(message.contains("mechanism fatigue") && message.contains("fraction"), "{message}");
        }
    }
}
