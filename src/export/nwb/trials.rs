//! The table of trials of an NWB file.

use std::collections::BTreeMap;

use hdf5_pure::{AttrValue, GroupBuilder};

use super::super::text_columns::{TextColumn, text_columns};
use super::super::trial_times::PlacedTrial;
use super::objects::{NwbType, ObjectIds, text};
use crate::dataset::Trial;

/// Where the table is.
const TRIALS_PATH: &str = "/intervals/trials";

/// Names that NWB gives a meaning of its own.
const NWB_NAMES: [&str; 5] = ["id", "tags", "tags_index", "timeseries", "timeseries_index"];

/// Columns of `fit.csv` that the table of trials has already.
const TRIAL_KEYS: [&str; 5] = ["trial", "velocity_rad_s", "torque_nm", "repetition", "condition"];

/// A row of a table of text.
type TextRow = BTreeMap<String, String>;

/// A column of the table.
struct NwbColumn {
    name: String,
    description: String,
    cells: NwbCells,
}

/// The cells of a column.
enum NwbCells {
    Numbers(Vec<f64>),
    Counts(Vec<i32>),
    Texts(Vec<String>),
}

/// Adds the table of the trials to the group `intervals`; `left_out` trials of the session have no place in it. `fits` are the rows of
/// `fit.csv`.
pub fn add_trials(
    intervals: &mut GroupBuilder,
    placed: &[PlacedTrial],
    left_out: usize,
    fits: &BTreeMap<u32, TextRow>,
    ids: &ObjectIds,
) {
    let mut columns = own_columns(placed);
    let extra: Vec<&TextRow> = placed.iter().map(|own| &own.trial.extra).collect();
    add_text_columns(&mut columns, &extra, "trials.csv");
    let none = TextRow::new();
    let fits: BTreeMap<u32, TextRow> = fits.iter().map(|(trial, row)| (*trial, without_keys(row))).collect();
    let fitted: Vec<&TextRow> =
        placed.iter().map(|own| fits.get(&own.trial.number).unwrap_or(&none)).collect();
    add_text_columns(&mut columns, &fitted, "results/fit.csv, empty or NaN for a trial without a fit");

    let mut table = ids.group(intervals, NwbType::TimeIntervals, TRIALS_PATH);
    let mut description =
        "The trials, in the order in which they were run; id is the number of the trial. A trial \
                           lasts from its first to its last sample."
            .to_owned();
    if left_out > 0 {
        description += &format!(
            " Trials without an onset or without samples are left out ({left_out}): nobody knows when they were."
        );
    }
    table.set_attr("description", text(description));
    table.set_attr(
        "colnames",
        AttrValue::VarLenStringArray(columns.iter().map(|column| column.name.clone()).collect()),
    );
    let numbers: Vec<i32> = placed.iter().map(|own| own.trial.number as i32).collect();
    let id = table.create_dataset("id").with_i32_data(&numbers);
    ids.identify(id, NwbType::ElementIdentifiers, &format!("{TRIALS_PATH}/id"));
    for column in &columns {
        add_column(&mut table, column, ids);
    }
    intervals.add_group(table.finish());
}

/// The columns that every session has.
fn own_columns(placed: &[PlacedTrial]) -> Vec<NwbColumn> {
    let mut columns = Vec::new();
    let mut add = |name: &str, description: &str, cells| {
        columns.push(NwbColumn { name: name.to_owned(), description: description.to_owned(), cells });
    };
    let times = |of: fn(&PlacedTrial) -> f64| NwbCells::Numbers(placed.iter().map(of).collect());
    let texts = |of: fn(&Trial) -> String| NwbCells::Texts(placed.iter().map(|own| of(own.trial)).collect());
    add("start_time", "Time of the first sample, s", times(|own| own.sample_s(0)));
    add("stop_time", "Time at which the last sample is over, s", times(|own| own.end_s()));
    add("onset_time", "Time at which the ramp begins, s", times(|own| own.onset_s()));
    add(
        "velocity_rad_s",
        "Ramp velocity, rad/s; a negative one turns the other way",
        times(|own| own.trial.velocity_rad_s),
    );
    add("torque_nm", "Target torque, N m", times(|own| own.trial.torque_nm));
    let repetitions = placed.iter().map(|own| own.trial.repetition as i32).collect();
    add("repetition", "Repetition index of its condition, from 1", NwbCells::Counts(repetitions));
    if placed.iter().any(|own| own.trial.condition.is_some()) {
        add(
            "condition",
            "Label of the condition",
            texts(|trial| trial.condition.clone().unwrap_or_default()),
        );
    }
    add(
        "status",
        "ok; rejected: a rule of the protocol was broken; aborted: ended before its time",
        texts(|trial| trial.status.name().to_owned()),
    );
    columns
}

/// Adds the columns of a table of text, which is the file `file`.
fn add_text_columns(columns: &mut Vec<NwbColumn>, rows: &[&TextRow], file: &str) {
    let taken: Vec<&str> = columns.iter().map(|column| column.name.as_str()).chain(NWB_NAMES).collect();
    let more = text_columns(rows.iter().copied(), &taken);
    columns.extend(more.iter().map(|column| NwbColumn {
        name: column.field.clone(),
        description: format!("Column {} of {file}", column.name),
        cells: cells(column, rows),
    }));
}

fn cells(column: &TextColumn, rows: &[&TextRow]) -> NwbCells {
    if column.is_number {
        NwbCells::Numbers(rows.iter().map(|row| column.number(row).unwrap_or(f64::NAN)).collect())
    } else {
        NwbCells::Texts(rows.iter().map(|row| column.text(row).to_owned()).collect())
    }
}

/// A row of `fit.csv` without what says which trial it is of.
fn without_keys(row: &TextRow) -> TextRow {
    let own = row.iter().filter(|(name, _)| !TRIAL_KEYS.contains(&name.as_str()));
    own.map(|(name, cell)| (name.clone(), cell.clone())).collect()
}

fn add_column(table: &mut GroupBuilder, column: &NwbColumn, ids: &ObjectIds) {
    let dataset = table.create_dataset(&column.name);
    match &column.cells {
        NwbCells::Numbers(cells) => dataset.with_f64_data(cells),
        NwbCells::Counts(cells) => dataset.with_i32_data(cells),
        NwbCells::Texts(cells) => {
            dataset.with_vlen_strings(&cells.iter().map(String::as_str).collect::<Vec<&str>>())
        }
    };
    ids.identify(dataset, NwbType::VectorData, &format!("{TRIALS_PATH}/{}", column.name));
    dataset.set_attr("description", text(column.description.as_str()));
}
