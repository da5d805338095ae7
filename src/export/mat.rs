//! A .mat file of sessions: one struct for each, with a struct array of its trials.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::error::ExportError;
use super::fit_rows::fit_rows;
use super::mat_file::{self, LARGEST_VARIABLE, MatValue, StructArray, field_name};
use crate::dataset::{self, FurtherChannel, PROGRAM, Record, SESSION_FORMAT, Session, SessionCard, Trial};
use crate::files::{self, Folder};

/// The variable of the file.
const VARIABLE: &str = "sessions";

/// Name of a channel, and its samples in a record.
type RecordColumn = (&'static str, fn(&Record) -> Option<&Vec<f64>>);

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
    if files::exists(file) {
        return Err(ExportError::Exists(file.into()));
    }
    let sessions: Vec<MatValue> = folders.iter().map(|folder| session(folder)).collect::<Result<_, _>>()?;
    let variable = MatValue::Structs(sessions_array(sessions));
    let bytes = mat_file::file(PROGRAM, &[(VARIABLE, variable)])
        .map_err(|(_, bytes)| ExportError::TooLarge { path: file.into(), bytes, limit: LARGEST_VARIABLE })?;
    let above = Folder::open(file.parent().unwrap_or(Path::new("")));
    above
        .and_then(|above| above.write(Path::new(file.file_name().unwrap_or_default()), &bytes))
        .map_err(ExportError::at(file))
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
    let fits = fit_rows(folder)?;
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
    ]))
}

/// The trials, in the order in which they were run. A field is there where any trial of the session has it.
fn trials(session: &Session, fits: &BTreeMap<u32, BTreeMap<String, String>>) -> StructArray {
    let mut channels: Vec<RecordColumn> = vec![
        ("theta_m_rad", |record| Some(&record.theta_m_rad)),
        ("torque_l_nm", |record| Some(&record.torque_l_nm)),
    ];
    let optional: [RecordColumn; 2 + FurtherChannel::COUNT] = [
        ("emg_fcr_mvc", |record| record.emg_fcr_mvc.as_ref()),
        ("emg_ecr_mvc", |record| record.emg_ecr_mvc.as_ref()),
        (FurtherChannel::HandleAngle.column(), |record| record.theta_l_rad.as_ref()),
        (FurtherChannel::HandleAcceleration.column(), |record| record.alpha_l_rad_s2.as_ref()),
        (FurtherChannel::HandTorque.column(), |record| record.torque_h_nm.as_ref()),
        (FurtherChannel::JointAngle.column(), |record| record.theta_j_rad.as_ref()),
    ];
    let is_measured = |of: &fn(&Record) -> Option<&Vec<f64>>| {
        session.trials.iter().any(|trial| of(&trial.record).is_some())
    };
    channels.extend(optional.into_iter().filter(|(_, of)| is_measured(of)));
    let table = Columns::of(session.trials.iter().map(|trial| &trial.extra));
    let fit = Columns::of(fits.values());
    let mut fields: Vec<String> = TRIAL_FIELDS.iter().map(|name| (*name).to_owned()).collect();
    fields.extend(channels.iter().map(|(name, _)| (*name).to_owned()));
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
            channels.iter().map(|(_, of)| MatValue::Numbers(of(record).cloned().unwrap_or_default())),
        );
        values.push(table.record(&trial.extra));
        values.push(fits.get(&trial.number).map_or(MatValue::Numbers(Vec::new()), |row| fit.record(row)));
        values
    };
    StructArray { fields, elements: session.trials.iter().map(element).collect() }
}

/// The columns of a table of text: a column is one of numbers if every cell that is not empty is a number.
struct Columns {
    /// Name in the table, name of the field, whether it is a column of numbers.
    columns: Vec<(String, String, bool)>,
}

impl Columns {
    fn of<'a>(rows: impl Iterator<Item = &'a BTreeMap<String, String>> + Clone) -> Self {
        let names: BTreeSet<&String> = rows.clone().flat_map(BTreeMap::keys).collect();
        let is_number = |name: &String| {
            let cells = rows.clone().filter_map(|row| row.get(name)).filter(|cell| !cell.is_empty());
            cells.clone().count() > 0 && cells.clone().all(|cell| cell.parse::<f64>().is_ok())
        };
        let mut taken = BTreeSet::new();
        let mut columns = Vec::new();
        for name in names {
            let stem = field_name(name);
            // Names that only differ in what MATLAB does not allow get a number.
            let numbered = (2..).map(|number| {
                let ending = format!("_{number}");
                format!("{}{ending}", &stem[..stem.len().min(63 - ending.len())])
            });
            let Some(field) = std::iter::once(stem.clone()).chain(numbered).find(|own| !taken.contains(own))
            else {
                continue;
            };
            taken.insert(field.clone());
            columns.push((name.clone(), field, is_number(name)));
        }
        Self { columns }
    }

    fn record(&self, row: &BTreeMap<String, String>) -> MatValue {
        let value = |name: &str, is_number: bool| {
            let cell = row.get(name).map_or("", String::as_str);
            if is_number { MatValue::number(cell.parse().ok()) } else { MatValue::Text(cell.to_owned()) }
        };
        MatValue::record(
            self.columns
                .iter()
                .map(|(name, field, is_number)| (field.clone(), value(name, *is_number)))
                .collect(),
        )
    }
}
