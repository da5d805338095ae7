//! A .mat file of sessions: one struct for each, with a struct array of its trials.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::ExportError;
use super::fit_rows::fit_rows;
use super::mat_attached::attached;
use super::mat_file::{self, LARGEST_VARIABLE, MatValue, StructArray};
use super::new_file::{refuse_existing, write_new};
use super::record_channels::measured_channels;
use super::text_columns::{TextColumn, text_columns};
use crate::dataset::{self, PROGRAM, SESSION_FORMAT, Session, SessionCard, Trial};

/// The variable of the file.
const VARIABLE: &str = "sessions";

/// The fields of a trial that every session has, in order.
const TRIAL_FIELDS: [&str; 9] = [
    "trial",
    "velocity_rad_s",
    "torque_nm",
    "repetition",
    "condition",
    "status",
    "onset_s",
    "start_s",
    "t_s",
];

/// Writes the sessions in `folders` to a new file.
///
/// # Errors
/// If a session or its `fit.csv` cannot be read, the sessions are too large for the format, or the file exists already or
/// cannot be written.
pub fn write(folders: &[PathBuf], file: &Path) -> Result<(), ExportError> {
    refuse_existing(file)?;
    let sessions: Vec<MatValue> = folders.iter().map(|folder| session(folder)).collect::<Result<_, _>>()?;
    let variable = MatValue::Structs(sessions_array(sessions));
    let bytes = mat_file::file(PROGRAM, &[(VARIABLE, variable)])
        .map_err(|(_, bytes)| ExportError::TooLarge { path: file.into(), bytes, limit: LARGEST_VARIABLE })?;
    write_new(file, &bytes)
}

/// One struct array of the structs of all sessions, which have the same fields.
fn sessions_array(sessions: Vec<MatValue>) -> StructArray {
    let mut array = StructArray::default();
    for session in sessions {
        let MatValue::Structs(own) = session else { continue };
        array.fields = own.fields;
        array.elements.extend(own.elements);
    }
    array
}

fn session(folder: &Path) -> Result<MatValue, ExportError> {
    let session = dataset::load(folder)?;
    let card = SessionCard::read(folder)?;
    let fits = fit_rows(folder, &session)?;
    let text = |text: Option<&String>| MatValue::Text(text.cloned().unwrap_or_default());
    let name = folder.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let lever = session.lever.map_or_else(
        || MatValue::Numbers(Vec::new()),
        |lever| {
            MatValue::record(vec![
                ("inertia_kg_m2".into(), MatValue::number(Some(lever.inertia_kg_m2))),
                ("damping_nm_s_per_rad".into(), MatValue::number(Some(lever.damping_nm_s_per_rad))),
                ("stiffness_nm_per_rad".into(), MatValue::number(Some(lever.stiffness_nm_per_rad))),
            ])
        },
    );
    // Descriptions without a fixed form are kept as the JSON that they are: jsondecode reads them.
    let json = |value: Value| MatValue::Text(if value.is_null() { String::new() } else { value.to_string() });
    let subject_fields = Value::Object(card.subject.fields.clone());
    Ok(MatValue::record(vec![
        ("format".into(), MatValue::Text(SESSION_FORMAT.into())),
        ("name".into(), MatValue::Text(name)),
        ("subject".into(), MatValue::Text(session.subject.id.clone())),
        ("subject_fields".into(), json(subject_fields)),
        ("started_utc".into(), text(card.about.started_utc.as_ref())),
        ("operator".into(), text(card.about.operator.as_ref())),
        ("sample_rate_hz".into(), MatValue::number(Some(session.sample_rate_hz))),
        ("lever".into(), lever),
        ("recorded_filter".into(), json(serde_json::json!(session.recorded_filter))),
        ("channels".into(), json(serde_json::json!(card.channels))),
        ("trials".into(), MatValue::Structs(trials(&session, &fits))),
        ("attached".into(), attached(folder)?),
    ]))
}

/// The trials, in the order in which they were run. A field is there where any trial of the session has it.
fn trials(session: &Session, fits: &BTreeMap<u32, BTreeMap<String, String>>) -> StructArray {
    let channels = measured_channels(session);
    let table = text_columns(session.trials.iter().map(|trial| &trial.extra), &[]);
    let fit = text_columns(fits.values(), &[]);
    let mut fields: Vec<String> = TRIAL_FIELDS.iter().map(|name| (*name).to_owned()).collect();
    fields.extend(channels.iter().map(|own| own.column.to_owned()));
    fields.extend(["table".to_owned(), "fit".to_owned()]);
    let element = |trial: &Trial| {
        let record = &trial.record;
        let time_s = |sample: usize| record.start_s + sample as f64 / session.sample_rate_hz;
        let mut values = vec![
            MatValue::number(Some(f64::from(trial.number))),
            MatValue::number(Some(trial.velocity_rad_s)),
            MatValue::number(Some(trial.torque_nm)),
            MatValue::number(Some(f64::from(trial.repetition))),
            MatValue::Text(trial.condition.clone().unwrap_or_default()),
            MatValue::Text(trial.status.name().to_owned()),
            MatValue::number(trial.onset_s),
            MatValue::number(Some(record.start_s)),
            MatValue::Numbers((0..record.theta_m_rad.len()).map(time_s).collect()),
        ];
        values.extend(
            channels.iter().map(|own| MatValue::Numbers((own.samples)(record).cloned().unwrap_or_default())),
        );
        values.push(row(&table, &trial.extra));
        let own = fits.get(&trial.number);
        values.push(own.map_or(MatValue::Numbers(Vec::new()), |own| row(&fit, own)));
        values
    };
    StructArray { fields, elements: session.trials.iter().map(element).collect() }
}

/// A row of a table of text.
fn row(columns: &[TextColumn], cells: &BTreeMap<String, String>) -> MatValue {
    let value = |column: &TextColumn| match column.is_number {
        true => MatValue::number(column.number(cells)),
        false => MatValue::Text(column.text(cells).to_owned()),
    };
    MatValue::record(columns.iter().map(|column| (column.field.clone(), value(column))).collect())
}
