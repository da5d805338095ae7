//! Whether records and tables are as the session left them, where the journal has no sum of them.

use std::collections::{BTreeMap, BTreeSet};
use std::io::ErrorKind;

use crate::dataset::error::{DatasetError, FilePlace};
use crate::dataset::recovery::{RecoveredSession, RecoveredState};
use crate::dataset::tables::{self, RIG_FOLDER, RIG_TABLE};
use crate::dataset::trial_csv_writer::TrialCsvWriter;
use crate::files::limits;

/// The tables that are written anew when a session is resumed.
const TABLES: [&str; 3] = ["trials.csv", "familiarisation.csv", RIG_TABLE];

/// The folders of the records, each with how the names of its records begin.
const RECORDS: [(&str, &[&str]); 4] = [
    ("before", &["offset", "effort-"]),
    (RIG_FOLDER, &["rig-trial-"]),
    ("familiarisation", &["trial-"]),
    ("trials", &["trial-"]),
];

/// Records, complete or not, whose name the session would give to a record to come, and which are none of those in `begun`. The journal has
/// the beginning of a record before the record has a file, so none can be left by a program that was broken off.
pub fn unmentioned_records(
    session: &RecoveredSession,
    begun: &BTreeSet<String>,
) -> Result<Vec<String>, DatasetError> {
    let mut files = Vec::new();
    for (inside, beginnings) in RECORDS {
        let entries = session.folder.folder().folder(inside).and_then(|folder| folder.entries());
        let entries = match entries {
            Err(error) if error.kind() == ErrorKind::NotFound => continue,
            entries => entries.map_err(|source| session.folder.unreadable(inside, source))?,
        };
        for name in entries.into_iter().filter_map(|entry| entry.name.into_string().ok()) {
            let record = name.strip_suffix(".part").unwrap_or(&name);
            if is_of_a_record(record, beginnings) && !begun.contains(&format!("{inside}/{record}")) {
                files.push(format!("{inside}/{name}"));
            }
        }
    }
    files.sort();
    Ok(files)
}

/// Whether a session could call a record so: a beginning, then numbers, of which there may be none and one more after `-again-`.
fn is_of_a_record(name: &str, beginnings: &[&str]) -> bool {
    let Some(stem) = name.strip_suffix(".csv") else { return false };
    let are_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    beginnings.iter().filter_map(|beginning| stem.strip_prefix(beginning)).any(|numbers| {
        let (number, again) = numbers.split_once("-again-").unwrap_or((numbers, ""));
        are_digits(number) && are_digits(again)
    })
}

/// Each table with a row that the session never wrote of a trial that is over in `last`, the state after its journal. A row may be
/// missing, as the journal is written first.
pub fn edited_tables(session: &RecoveredSession, last: &RecoveredState) -> Result<Vec<String>, DatasetError> {
    let mut edited = Vec::new();
    for name in TABLES {
        if !session.folder.folder().contains(name) {
            continue;
        }
        let text = session.folder.text(name, limits::TABLE_BYTES, None)?;
        let found = cells(&text)
            .map_err(|_| DatasetError::NotText { at: FilePlace::file(session.folder.name(name)) })?;
        let mut ever = RowsWritten::of(last, session, name);
        if ever.has_written(&found) {
            continue;
        }
        // Rows change with what follows them, such as the torque offset that is measured again.
        session.state_through(|state| ever.extend(RowsWritten::of(state, session, name)))?;
        if !ever.has_written(&found) {
            edited.push(format!("{name} changed"));
        }
    }
    Ok(edited)
}

/// A row of a table: its cells by the names of their columns.
type Cells = BTreeMap<String, String>;

/// Rows that the session wrote, by the number of their trial.
#[derive(Default)]
struct RowsWritten(BTreeMap<String, BTreeSet<Cells>>);

impl RowsWritten {
    /// Those of the table `name` in `state`.
    fn of(state: &RecoveredState, session: &RecoveredSession, name: &str) -> Self {
        let rows = TrialCsvWriter::new(session.settings.sample_rate_hz);
        let written = tables::of_session(&state.progress, &session.settings, &rows);
        let text = written.into_iter().find(|(own, _)| *own == name).map(|(_, bytes)| bytes);
        let text = String::from_utf8(text.unwrap_or_default()).unwrap_or_default();
        let mut by_number = Self::default();
        for row in cells(&text).unwrap_or_default() {
            by_number.0.entry(row[TRIAL].clone()).or_default().insert(row);
        }
        by_number
    }

    fn extend(&mut self, other: Self) {
        for (number, rows) in other.0 {
            self.0.entry(number).or_default().extend(rows);
        }
    }

    /// Whether each row is one of these as far as it goes, or of a trial of which there is none. An older version may have
    /// written fewer columns.
    fn has_written(&self, found: &[Cells]) -> bool {
        found.iter().all(|row| {
            let own = row.get(TRIAL).and_then(|number| self.0.get(number));
            own.is_none_or(|own| {
                let has = |own: &Cells, (column, cell): (&String, &String)| {
                    own.get(column).is_some_and(|own| are_equal(own, cell))
                };
                own.iter().any(|own| row.iter().all(|cell| has(own, cell)))
            })
        })
    }
}

/// Whether two cells say the same: another version may print or round a number otherwise.
fn are_equal(own: &str, found: &str) -> bool {
    let number = |cell: &str| cell.trim().parse::<f64>().ok();
    match (number(own), number(found)) {
        (Some(own), Some(found)) => (own - found).abs() <= LAST_DIGITS * own.abs(),
        _ => own == found,
    }
}

/// Numbers that differ by no more than this part of them are one number, rounded otherwise: doubles have 16 digits, tables fewer than 9.
const LAST_DIGITS: f64 = 1e-9;

/// The column with the number of the trial.
const TRIAL: &str = "trial";

/// The rows of a table.
fn cells(text: &str) -> Result<Vec<Cells>, csv::Error> {
    csv::ReaderBuilder::new().flexible(true).from_reader(text.as_bytes()).deserialize().collect()
}
