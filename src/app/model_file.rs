//! Model files: read for a fit, or as the mechanisms of a virtual wrist.

use std::path::Path;

use crate::files::{self, limits};
use crate::fit::{AddedMechanism, Model, ModelError, ParameterSpec, Scope};
use crate::rig::virtual_wrist::{MechanismList, Person, Setup};
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::MechanismKind;

use super::failure::Failure;

/// The model in `file`; without a file, the model of the paper.
pub fn read_model(file: Option<&Path>) -> Result<Model, Failure> {
    let Some(path) = file else { return Ok(Model::paper()) };
    let file = path.display().to_string();
    let text = files::read_text(path, limits::SETTINGS_BYTES)
        .map_err(|source| Failure::Read { file: file.clone(), source })?;
    Model::parse(&text).map_err(|source| Failure::Model { file, source })
}

/// Adds the mechanisms of the model in `file` to a virtual wrist, at the values that the file gives.
pub fn add_mechanisms_of_model(file: &Path, person: &Person, setup: &mut Setup) -> Result<(), Failure> {
    let model = read_model(Some(file))?;
    let added = mechanisms(&model)
        .and_then(|added| only_once(&added, person, setup).map(|()| added))
        .map_err(|source| Failure::Model { file: file.display().to_string(), source })?;
    setup.mechanisms = setup.mechanisms.and(&added);
    Ok(())
}

/// The mechanisms of `model` at the values that it gives.
fn mechanisms(model: &Model) -> Result<MechanismList, ModelError> {
    for (name, treatment) in BASE_PARAMETERS.iter().zip(&model.base) {
        if treatment.scope == Scope::Fixed {
            return Err(ModelError::Value {
                path: format!("parameters.{name}"),
                message:
                    "is fixed, but the parameters of a virtual wrist stand in the subject file; expected \
                          mechanisms only (see --subject)"
                        .to_owned(),
            });
        }
    }
    model
        .mechanisms
        .iter()
        .enumerate()
        .map(|(index, switched)| Ok((switched.kind, values(index, switched)?)))
        .collect()
}

fn values(index: usize, switched: &AddedMechanism) -> Result<Vec<f64>, ModelError> {
    let value = |(name, treatment): (&str, &ParameterSpec)| {
        treatment.value.filter(|_| treatment.law.is_empty()).ok_or_else(|| ModelError::Value {
            path: format!("mechanisms[{index}].parameters.{name}"),
            message: "expected a value, which is what a virtual wrist runs with, and no law".to_owned(),
        })
    };
    let names = switched.kind.parameters().iter().map(|parameter| parameter.name);
    names.zip(&switched.parameters).map(value).collect()
}

/// The same mechanism twice would act twice.
fn only_once(added: &MechanismList, person: &Person, setup: &Setup) -> Result<(), ModelError> {
    let there: Vec<MechanismKind> = person.mechanisms.and(&setup.mechanisms).kinds;
    match added.kinds.iter().position(|kind| there.contains(kind)) {
        None => Ok(()),
        Some(index) => Err(ModelError::Value {
            path: format!("mechanisms[{index}].mechanism"),
            message: format!(
                "\"{}\" is already in the subject file or the rig file; expected it in one of them",
                added.kinds[index].id()
            ),
        }),
    }
}
