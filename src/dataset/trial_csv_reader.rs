//! The record of one trial: reading `trials/*.csv`, and whether its time axis is sound.

use super::csv_input::CsvTable;
use super::error::{DatasetError, FilePlace};
use super::even_times::{STEP_TOLERANCE, UnevenTime, grain, uneven_time};
use super::{FurtherChannel, Record};

/// How much the clock of a recording may differ from the rate of the session.
const CLOCK_TOLERANCE: f64 = 1e-3;

/// Reads a record; `file` is its name for messages.
pub(super) fn parse(file: &str, text: &str, sample_rate_hz: f64) -> Result<Record, DatasetError> {
    let mut table =
        CsvTable::new(file.to_owned(), text, "a header t_s,theta_m_rad,torque_l_nm and a row a sample")?;
    let time = table.column("t_s")?;
    let angle = table.column("theta_m_rad")?;
    let torque = table.column("torque_l_nm")?;
    let fcr = table.find("emg_fcr_mvc");
    let ecr = table.find("emg_ecr_mvc");

    let rows = text.len() / 24;
    let mut times_s = Vec::with_capacity(rows);
    let mut record = Record {
        theta_m_rad: Vec::with_capacity(rows),
        torque_l_nm: Vec::with_capacity(rows),
        emg_fcr_mvc: fcr.map(|_| Vec::with_capacity(rows)),
        emg_ecr_mvc: ecr.map(|_| Vec::with_capacity(rows)),
        ..Record::default()
    };
    let further: Vec<(FurtherChannel, usize)> = FurtherChannel::ALL
        .into_iter()
        .filter_map(|channel| Some((channel, table.find(channel.column())?)))
        .collect();
    for (channel, _) in &further {
        *record.further_mut(*channel) = Some(Vec::with_capacity(rows));
    }
    let mut lines = Vec::with_capacity(rows);
    while table.next_row()? {
        times_s.push(table.number(time)?);
        record.theta_m_rad.push(table.number(angle)?);
        record.torque_l_nm.push(table.number(torque)?);
        if let (Some(column), Some(signal)) = (fcr, &mut record.emg_fcr_mvc) {
            signal.push(table.number(column)?);
        }
        if let (Some(column), Some(signal)) = (ecr, &mut record.emg_ecr_mvc) {
            signal.push(table.number(column)?);
        }
        for (channel, column) in &further {
            let value = table.number(*column)?;
            record.further_mut(*channel).get_or_insert_default().push(value);
        }
        lines.push(table.line());
    }
    check_times(&times_s, &record.theta_m_rad, sample_rate_hz, |row| {
        FilePlace::cell(file, lines[row], "column t_s")
    })?;
    record.start_s = times_s.first().copied().unwrap_or(0.0);
    Ok(record)
}

/// The commanded angles of the record of a rig trial, rad; `file` is its name for messages.
pub(super) fn parse_targets(file: &str, text: &str) -> Result<Vec<f64>, DatasetError> {
    let mut table = CsvTable::new(file.to_owned(), text, "a header with target_rad and a row a sample")?;
    let target = table.column("target_rad")?;
    let mut targets_rad = Vec::new();
    while table.next_row()? {
        targets_rad.push(table.number(target)?);
    }
    Ok(targets_rad)
}

/// Whether the samples lie where an even time axis of the session's rate puts them, as far as the angle of the motor shows it; `at` names
/// the place of a sample.
pub(super) fn check_times(
    times_s: &[f64],
    theta_rad: &[f64],
    sample_rate_hz: f64,
    at: impl Fn(usize) -> FilePlace,
) -> Result<(), DatasetError> {
    let Some(&first_s) = times_s.first() else { return Ok(()) };
    let step_s = 1.0 / sample_rate_hz;
    let rate = |row: usize| DatasetError::Rate {
        at: at(row),
        found_hz: 1.0 / median_step(times_s),
        expected_hz: sample_rate_hz,
    };
    for (row, pair) in times_s.windows(2).enumerate() {
        let (before_s, after_s, row) = (pair[0], pair[1], row + 1);
        if after_s <= before_s {
            return Err(DatasetError::StepBack { at: at(row), before_s, after_s, step_s });
        }
        let periods = (after_s - before_s) * sample_rate_hz;
        if (periods - 1.0).abs() > STEP_TOLERANCE {
            let usual_periods = median_step(times_s) * sample_rate_hz;
            if (usual_periods - 1.0).abs() > STEP_TOLERANCE {
                return Err(rate(row));
            }
            return Err(DatasetError::Gap { at: at(row), before_s, after_s, step_s });
        }
        let slip = (after_s - first_s) * sample_rate_hz - row as f64;
        if slip.abs() > STEP_TOLERANCE + CLOCK_TOLERANCE * row as f64 {
            return Err(rate(row));
        }
    }
    match uneven_time(times_s, theta_rad, step_s, || grain(times_s)) {
        Some(UnevenTime { sample, off_s, moved_rad }) => {
            Err(DatasetError::Uneven { at: at(sample), off_s, moved_rad })
        }
        None => Ok(()),
    }
}

/// The step from sample to sample that half of the steps do not exceed.
fn median_step(times_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    steps.sort_by(f64::total_cmp);
    steps[steps.len() / 2]
}
