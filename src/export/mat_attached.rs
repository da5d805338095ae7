//! EMG of other devices in a .mat file: a struct for each attachment, at the rate of its device.

use std::path::Path;

use super::error::ExportError;
use super::mat_file::{MatValue, StructArray};
use crate::attach::{AttachedChannel, AttachedRecording, AttachedTrial, attached_recordings};

/// The fields of an attachment, in order.
const ATTACHED_FIELDS: [&str; 5] = ["name", "rate_hz", "emg_fcr", "emg_ecr", "trials"];

/// The fields of a trial of an attachment, in order.
const ATTACHED_TRIAL_FIELDS: [&str; 4] = ["trial", "start_s", "emg_fcr", "emg_ecr"];

/// The attachments of the session in `folder` that have EMG.
pub fn attached(folder: &Path) -> Result<MatValue, ExportError> {
    let elements = attached_recordings(folder)?.iter().map(recording).collect();
    Ok(MatValue::Structs(array(&ATTACHED_FIELDS, elements)))
}

fn recording(own: &AttachedRecording) -> Vec<MatValue> {
    let [fcr, ecr] = own.emg.each_ref().map(|channel| channel.as_ref().map_or_else(nothing, described));
    let trials = own.trials.iter().map(|(number, trial)| samples(*number, trial)).collect();
    vec![
        MatValue::Text(own.name.clone()),
        MatValue::number(Some(own.rate_hz)),
        fcr,
        ecr,
        MatValue::Structs(array(&ATTACHED_TRIAL_FIELDS, trials)),
    ]
}

/// What is known of a channel.
fn described(channel: &AttachedChannel) -> MatValue {
    MatValue::record(vec![
        ("column".into(), MatValue::Text(channel.column.clone())),
        ("unit".into(), MatValue::Text(channel.unit.clone().unwrap_or_default())),
        ("at_mvc".into(), MatValue::number(channel.at_mvc)),
    ])
}

/// The samples of a trial, as they came.
fn samples(number: u32, trial: &AttachedTrial) -> Vec<MatValue> {
    let [fcr, ecr] = trial.values.each_ref().map(|own| MatValue::Numbers(own.clone().unwrap_or_default()));
    vec![MatValue::number(Some(f64::from(number))), MatValue::number(Some(trial.start_s)), fcr, ecr]
}

fn nothing() -> MatValue {
    MatValue::Numbers(Vec::new())
}

fn array(fields: &[&str], elements: Vec<Vec<MatValue>>) -> StructArray {
    StructArray { fields: fields.iter().map(|name| (*name).to_owned()).collect(), elements }
}
