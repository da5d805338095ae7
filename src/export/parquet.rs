//! Tidy Parquet tables with one row per sample or one row per trial.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use parquet::basic::{Compression, LogicalType, Repetition, Type as Physical};
use parquet::data_type::{ByteArray, ByteArrayType, DoubleType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::SerializedFileWriter;
use parquet::schema::types::Type;

use super::error::ExportError;
use super::fit_rows::fit_rows;
use super::new_file::refuse_existing;
use super::rows::Rows;
use crate::dataset::{self, FurtherChannel, Session, Trial};
use crate::files::Folder;

/// A column of the table.
enum Column {
    Text(Vec<Option<String>>),
    Count(Vec<i32>),
    Number(Vec<Option<f64>>),
}

type ParquetColumns = Vec<(String, Column)>;

/// Writes the table of the sessions in `folders` to a new file.
///
/// # Errors
/// If a session or its `fit.csv` cannot be read, or the file exists already or cannot be written.
pub fn write(folders: &[PathBuf], file: &Path, rows: Rows) -> Result<(), ExportError> {
    refuse_existing(file)?;
    let sessions: Vec<(PathBuf, Session)> = folders
        .iter()
        .map(|folder| Ok((folder.clone(), dataset::load(folder)?)))
        .collect::<Result<_, ExportError>>()?;
    let groups: Vec<ParquetColumns> = match rows {
        // A group of rows a session: readers can pass over the sessions that they do not want.
        Rows::Samples => {
            // All groups have the same columns.
            let has = |channel: &FurtherChannel| {
                sessions.iter().any(|(_, session)| session.further_channels().contains(channel))
            };
            let further: Vec<FurtherChannel> = FurtherChannel::ALL.into_iter().filter(has).collect();
            sessions.iter().map(|(folder, session)| samples(&name(folder), session, &further)).collect()
        }
        Rows::Trials => vec![trials(&sessions)?],
    };
    let above = Folder::open(file.parent().unwrap_or(Path::new("")));
    let mut output = above
        .and_then(|above| above.begin_file(file.file_name().unwrap_or_default()))
        .map_err(ExportError::at(file))?;
    let refused = |error: ParquetError| ExportError::Writer { path: file.into(), message: error.to_string() };
    write_groups(output.file(), &groups).map_err(refused)?;
    output.finish().map_err(ExportError::at(file))
}

fn name(folder: &Path) -> String {
    folder
        .file_name()
        .map_or_else(|| folder.display().to_string(), |name| name.to_string_lossy().into_owned())
}

/// The first columns of both tables, which identify the trial.
fn keys<'a>(
    session_name: &str,
    session: &Session,
    trials: impl Iterator<Item = &'a Trial> + Clone,
) -> ParquetColumns {
    let text = |of: &dyn Fn(&Trial) -> Option<String>| Column::Text(trials.clone().map(of).collect());
    let number =
        |of: &dyn Fn(&Trial) -> f64| Column::Number(trials.clone().map(|trial| Some(of(trial))).collect());
    vec![
        ("session".into(), text(&|_| Some(session_name.to_owned()))),
        ("subject".into(), text(&|_| Some(session.subject.id.clone()))),
        ("trial".into(), Column::Count(trials.clone().map(|trial| trial.number as i32).collect())),
        ("velocity_rad_s".into(), number(&|trial| trial.velocity_rad_s)),
        ("torque_nm".into(), number(&|trial| trial.torque_nm)),
        ("repetition".into(), Column::Count(trials.clone().map(|trial| trial.repetition as i32).collect())),
        ("condition".into(), text(&|trial| trial.condition.clone())),
        ("status".into(), text(&|trial| Some(trial.status.name().to_owned()))),
    ]
}

fn samples(session_name: &str, session: &Session, further: &[FurtherChannel]) -> ParquetColumns {
    let each =
        session.trials.iter().flat_map(|trial| (0..trial.record.theta_m_rad.len()).map(move |i| (trial, i)));
    let number = |of: &dyn Fn(&Trial, usize) -> Option<f64>| {
        Column::Number(each.clone().map(|(t, i)| of(t, i)).collect())
    };
    let time_s = |trial: &Trial, i: usize| trial.record.start_s + i as f64 / session.sample_rate_hz;
    let mut columns = keys(session_name, session, each.clone().map(|(trial, _)| trial));
    columns.extend([
        ("t_s".into(), number(&|trial, i| Some(time_s(trial, i)))),
        ("t_from_onset_s".into(), number(&|trial, i| Some(time_s(trial, i) - trial.onset_s?))),
        ("theta_m_rad".into(), number(&|trial, i| Some(trial.record.theta_m_rad[i]))),
        ("torque_l_nm".into(), number(&|trial, i| Some(trial.record.torque_l_nm[i]))),
        ("emg_fcr_mvc".into(), number(&|trial, i| Some(trial.record.emg_fcr_mvc.as_ref()?[i]))),
        ("emg_ecr_mvc".into(), number(&|trial, i| Some(trial.record.emg_ecr_mvc.as_ref()?[i]))),
    ]);
    columns.extend(further.iter().map(|channel| {
        (channel.column().into(), number(&|trial, i| Some(trial.record.further(*channel)?[i])))
    }));
    columns
}

/// All trials of all sessions: the keys, the onset, further columns of the sessions' tables, and those of their fits.
fn trials(sessions: &[(PathBuf, Session)]) -> Result<ParquetColumns, ExportError> {
    let mut columns: ParquetColumns = Vec::new();
    let mut more: Vec<BTreeMap<String, String>> = Vec::new();
    let mut onsets = Vec::new();
    for (folder, session) in sessions {
        let own = keys(&name(folder), session, session.trials.iter());
        if columns.is_empty() {
            columns = own
        } else {
            append(&mut columns, own)
        }
        onsets.extend(session.trials.iter().map(|trial| trial.onset_s));
        let fits = fit_rows(folder, session)?;
        more.extend(session.trials.iter().map(|trial| {
            let mut row = trial.extra.clone();
            row.extend(fits.get(&trial.number).cloned().unwrap_or_default());
            row
        }));
    }
    columns.push(("onset_s".into(), Column::Number(onsets)));
    let mut names: Vec<String> = Vec::new();
    for name in more.iter().flat_map(BTreeMap::keys) {
        if !names.contains(name) && !columns.iter().any(|(own, _)| own == name) {
            names.push(name.clone());
        }
    }
    columns.extend(names.into_iter().map(|name| {
        let cells: Vec<Option<&String>> =
            more.iter().map(|row| row.get(&name).filter(|text| !text.is_empty())).collect();
        let numbers: Option<Vec<Option<f64>>> =
            cells.iter().map(|cell| cell.map_or(Some(None), |text| text.parse().ok().map(Some))).collect();
        let words = || Column::Text(cells.iter().map(|cell| cell.cloned()).collect());
        (name, numbers.map_or_else(words, Column::Number))
    }));
    Ok(columns)
}

fn append(columns: &mut ParquetColumns, more: ParquetColumns) {
    for ((_, column), (_, more)) in columns.iter_mut().zip(more) {
        match (column, more) {
            (Column::Text(own), Column::Text(more)) => own.extend(more),
            (Column::Count(own), Column::Count(more)) => own.extend(more),
            (Column::Number(own), Column::Number(more)) => own.extend(more),
            // Both come from `keys`, which gives a column one kind.
            _ => {}
        }
    }
}

fn write_groups(file: &mut File, groups: &[ParquetColumns]) -> Result<(), ParquetError> {
    let fields = groups.first().into_iter().flatten().map(|(name, column)| {
        let builder = match column {
            Column::Text(_) => Type::primitive_type_builder(name, Physical::BYTE_ARRAY)
                .with_logical_type(Some(LogicalType::String))
                .with_repetition(Repetition::OPTIONAL),
            Column::Count(_) => {
                Type::primitive_type_builder(name, Physical::INT32).with_repetition(Repetition::REQUIRED)
            }
            Column::Number(_) => {
                Type::primitive_type_builder(name, Physical::DOUBLE).with_repetition(Repetition::OPTIONAL)
            }
        };
        builder.build().map(Arc::new)
    });
    let fields = fields.collect::<Result<Vec<_>, _>>()?;
    let schema = Arc::new(Type::group_type_builder("ramphold").with_fields(fields).build()?);
    let properties = WriterProperties::builder()
        .set_compression(Compression::SNAPPY)
        .set_created_by(dataset::PROGRAM.into())
        .build();
    let mut writer = SerializedFileWriter::new(file, schema, Arc::new(properties))?;
    for columns in groups {
        let mut group = writer.next_row_group()?;
        for (_, column) in columns {
            let Some(mut own) = group.next_column()? else { break };
            match column {
                Column::Text(cells) => {
                    let values: Vec<ByteArray> =
                        cells.iter().flatten().map(|text| ByteArray::from(text.as_str())).collect();
                    own.typed::<ByteArrayType>().write_batch(&values, Some(&levels(cells)), None)?;
                }
                Column::Count(cells) => {
                    own.typed::<Int32Type>().write_batch(cells, None, None)?;
                }
                Column::Number(cells) => {
                    let values: Vec<f64> = cells.iter().flatten().copied().collect();
                    own.typed::<DoubleType>().write_batch(&values, Some(&levels(cells)), None)?;
                }
            }
            own.close()?;
        }
        group.close()?;
    }
    writer.close().map(drop)
}

/// 1 where there is a value, 0 where there is none.
fn levels<T>(cells: &[Option<T>]) -> Vec<i16> {
    cells.iter().map(|cell| i16::from(cell.is_some())).collect()
}
