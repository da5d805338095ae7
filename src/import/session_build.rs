//! From tables and a mapping to a session.

use super::conditions::{grouped, repetitions};
use super::cut::cut;
use super::error::ImportError;
use super::mapping::{MappedSignal, Mapping};
use super::source_table::SourceTable;
use crate::consistency::MeasuredTrial;
use crate::dataset::{Record, Session, Status, Subject, Trial};

/// A session made of a foreign recording, before it is written.
#[derive(Debug, Clone)]
pub struct ImportedSession {
    /// The session; onsets are those that were found.
    pub session: Session,
    /// For each trial, the table it is from.
    pub sources: Vec<String>,
    /// Tables that gave no trial, and why.
    pub left_out: Vec<String>,
}

/// Makes a session of `tables` as `mapping` says.
///
/// # Errors
/// If a column is missing, the sample rate is not known, or no trial is found.
pub fn import(tables: Vec<SourceTable>, mapping: &Mapping) -> Result<ImportedSession, ImportError> {
    let rate_hz = sample_rate(&tables, mapping)?;
    let mut parts = Vec::new();
    for table in tables {
        parts.extend(cut(table, mapping, rate_hz)?);
    }
    let (mut trials, mut sources, mut left_out) = (Vec::new(), Vec::new(), Vec::new());
    let mut measured = Vec::new();
    for part in parts {
        let mut trial = trial(trials.len() as u32 + 1, record(&part, mapping)?);
        match MeasuredTrial::new(&trial, rate_hz) {
            Some(own) => {
                trial.onset_s = Some(own.motion_s);
                measured.push(own);
                trials.push(trial);
                sources.push(part.name);
            }
            None => left_out.push(format!("{}: no ramp stands out of the noise of the angle", part.name)),
        }
    }
    if trials.is_empty() {
        let reason = left_out.first().cloned().unwrap_or_else(|| "the source has no table".to_owned());
        return Err(ImportError::NoTrial {
            reason: format!("{reason}; check the column and the unit of the angle"),
        });
    }
    let speeds = grouped(&measured.iter().map(|own| own.speed_rad_s).collect::<Vec<_>>());
    let torques = grouped(&measured.iter().map(|own| own.hold_nm).collect::<Vec<_>>());
    let conditions: Vec<(f64, f64)> = speeds.into_iter().zip(torques).collect();
    for ((trial, condition), repetition) in trials.iter_mut().zip(&conditions).zip(repetitions(&conditions)) {
        (trial.velocity_rad_s, trial.torque_nm) = *condition;
        trial.repetition = repetition;
    }
    let session = Session {
        subject: Subject { id: mapping.subject.clone() },
        sample_rate_hz: rate_hz,
        lever: mapping.lever,
        recorded_filter: mapping.recorded_filter,
        trials,
    };
    Ok(ImportedSession { session, sources, left_out })
}

/// The sample rate that the mapping states, or that of the column of time.
fn sample_rate(tables: &[SourceTable], mapping: &Mapping) -> Result<f64, ImportError> {
    if let Some(rate_hz) = mapping.sample_rate_hz {
        return Ok(rate_hz);
    }
    let not_known = |reason: String| ImportError::NoTrial { reason };
    let (Some(time), Some(table)) = (&mapping.columns.time, tables.first()) else {
        return Err(not_known(
            "the mapping has neither sample_rate_hz nor columns.time; add one of them".into(),
        ));
    };
    let values = column(table, time, "the time")?;
    let step_s = match values.len() {
        0 | 1 => f64::NAN,
        count => time.convert(values[count - 1] - values[0] + time.zero) / (count - 1) as f64,
    };
    if step_s.is_nan() || step_s <= 0.0 {
        return Err(not_known(format!("{}: the column {} does not rise", table.name, time.column)));
    }
    // Rates are whole numbers; what is left is the rounding of the times.
    let rate_hz = 1.0 / step_s;
    let whole = libm::round(rate_hz);
    Ok(if (rate_hz - whole).abs() < 1e-3 * whole { whole } else { rate_hz })
}

fn record(table: &SourceTable, mapping: &Mapping) -> Result<Record, ImportError> {
    let columns = &mapping.columns;
    let converted = |signal: &MappedSignal, role: &'static str| -> Result<Vec<f64>, ImportError> {
        Ok(column(table, signal, role)?.iter().map(|value| signal.convert(*value)).collect())
    };
    let optional =
        |signal: &Option<MappedSignal>, role| signal.as_ref().map(|own| converted(own, role)).transpose();
    Ok(Record {
        start_s: 0.0,
        theta_m_rad: converted(&columns.angle, "the angle")?,
        torque_l_nm: converted(&columns.torque, "the torque")?,
        emg_fcr_mvc: optional(&columns.emg_fcr, "the EMG of the FCR")?,
        emg_ecr_mvc: optional(&columns.emg_ecr, "the EMG of the ECR")?,
    })
}

fn column<'a>(
    table: &'a SourceTable,
    signal: &MappedSignal,
    role: &'static str,
) -> Result<&'a [f64], ImportError> {
    table.column(&signal.column).ok_or_else(|| ImportError::NoColumn {
        table: table.name.clone(),
        column: signal.column.clone(),
        role,
        columns: table.names(),
    })
}

fn trial(number: u32, record: Record) -> Trial {
    Trial {
        number,
        file: format!("trials/trial-{number:03}.csv"),
        // Both are measured once all trials are there; a speed of zero stands in no table.
        velocity_rad_s: 1.0,
        torque_nm: 0.0,
        repetition: 1,
        condition: None,
        onset_s: None,
        status: Status::Ok,
        extra: Default::default(),
        record,
    }
}
