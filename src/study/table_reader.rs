//! Reading `study.csv` subject by subject.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::error::StudyError;
use super::part::EXCLUDED;
use super::study_file::StudyFit;
use crate::files::{self, text_of_cell};
use crate::fit::QUANTITIES;
use crate::protocol::shape::closest;

/// Name of the table with a row for each trial of each subject.
pub(super) const TABLE_FILE: &str = "study.csv";

/// A row of `study.csv` as the tables need it.
#[derive(Debug, Clone, PartialEq)]
pub struct StudyRow {
    /// Number of the session of the subject, from 1.
    pub session: u32,
    /// Velocity, rad/s, and torque, N m.
    pub condition: (f64, f64),
    /// Whether the values are those of each trial on its own.
    pub is_independent: bool,
    /// Whether the session is in study.csv and in no other table.
    pub is_excluded: bool,
    /// Values in the order of [`QUANTITIES`]; `None` where missing or where the fit did not converge.
    pub values: [Option<f64>; QUANTITIES.len()],
}

/// All rows of a subject.
#[derive(Debug, Clone, PartialEq)]
pub struct SubjectRows {
    /// The subject's identifier.
    pub subject: String,
    /// Line of the first row in the file.
    pub line: u64,
    /// The rows.
    pub rows: Vec<StudyRow>,
}

/// Iterator over the subjects in a table; only one subject is in memory at a time.
pub struct StudyTableReader {
    file: PathBuf,
    reader: csv::Reader<File>,
    columns: StudyColumns,
    record: csv::StringRecord,
    has_record: bool,
}

struct StudyColumns {
    subject: usize,
    velocity: usize,
    torque: usize,
    session: Option<usize>,
    converged: Option<usize>,
    fit: Option<usize>,
    excluded: Option<usize>,
    quantities: [Option<usize>; QUANTITIES.len()],
}

impl StudyTableReader {
    /// Opens a table. Only the columns `subject`, `velocity_rad_s` and `torque_nm` are required; a quantity without a column has no
    /// values. A column of nearly its name is refused: its values would be missing without a word.
    pub fn open(file: &Path) -> Result<Self, StudyError> {
        let wrong =
            |line: u64, message: String| StudyError::ResultTable { file: file.to_owned(), line, message };
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .from_reader(files::open(file).map_err(|error| wrong(1, error.to_string()))?);
        let header = reader.headers().map_err(|error| wrong(1, error.to_string()))?.clone();
        let find = |name: &str| header.iter().position(|column| column.trim() == name);
        let must = |name: &str| {
            let expected =
                || wrong(1, format!("column {name} is missing; expected the study.csv of a study"));
            find(name).ok_or_else(expected)
        };
        let missing: Vec<String> =
            QUANTITIES.iter().filter(|name| find(name).is_none()).map(|name| (*name).to_owned()).collect();
        for column in header.iter().map(str::trim).filter(|column| !is_known(column)) {
            if let Some(quantity) = closest(column, &missing) {
                let message = format!(
                    "column {column} is none of study.csv, and {quantity} is missing; rename it to {quantity}, or take it out"
                );
                return Err(wrong(1, message));
            }
        }
        let columns = StudyColumns {
            subject: must("subject")?,
            velocity: must("velocity_rad_s")?,
            torque: must("torque_nm")?,
            session: find("session"),
            converged: find("converged"),
            fit: find("fit"),
            excluded: find(EXCLUDED),
            quantities: QUANTITIES.map(find),
        };
        let mut rows = Self {
            file: file.to_owned(),
            reader,
            columns,
            record: csv::StringRecord::new(),
            has_record: true,
        };
        rows.advance()?;
        Ok(rows)
    }

    fn advance(&mut self) -> Result<(), StudyError> {
        self.has_record =
            self.reader.read_record(&mut self.record).map_err(|error| StudyError::ResultTable {
                file: self.file.clone(),
                line: error.position().map_or(0, csv::Position::line),
                message: error.to_string(),
            })?;
        Ok(())
    }

    fn line(&self) -> u64 {
        self.record.position().map_or(0, csv::Position::line)
    }

    fn wrong(&self, column: &str, text: &str, expected: &str) -> StudyError {
        StudyError::ResultTable {
            file: self.file.clone(),
            line: self.line(),
            message: format!("column {column}: {text:?}; expected {expected}"),
        }
    }

    fn number(&self, column: &str, place: usize) -> Result<f64, StudyError> {
        let text = self.record.get(place).unwrap_or_default().trim();
        let number = text.parse::<f64>().ok().filter(|value| value.is_finite());
        number.ok_or_else(|| self.wrong(column, text, "a finite number"))
    }

    fn row(&self) -> Result<StudyRow, StudyError> {
        let text = |place: usize| self.record.get(place).unwrap_or_default().trim();
        let session = match self.columns.session.map(text) {
            None | Some("") => 1,
            Some(text) => match text.parse() {
                Ok(session @ 1..=10_000) => session,
                _ => return Err(self.wrong("session", text, "a whole number from 1 to 10000")),
            },
        };
        let usable = self.columns.converged.is_none_or(|place| text(place) != "false");
        let mut values = [None; QUANTITIES.len()];
        for (value, (name, place)) in values.iter_mut().zip(QUANTITIES.iter().zip(self.columns.quantities)) {
            if let Some(place) = place.filter(|place| usable && !text(*place).is_empty()) {
                *value = Some(self.number(name, place)?);
            }
        }
        let velocity = self.number("velocity_rad_s", self.columns.velocity)?;
        let torque = self.number("torque_nm", self.columns.torque)?;
        let is_independent = self.columns.fit.is_none_or(|place| text(place) == StudyFit::Independent.name());
        let is_excluded = match self.columns.excluded.map(text) {
            None | Some("" | "false") => false,
            Some("true") => true,
            Some(other) => return Err(self.wrong(EXCLUDED, other, "true or false")),
        };
        Ok(StudyRow { session, is_independent, is_excluded, condition: (velocity, torque), values })
    }

    fn subject(&self) -> &str {
        text_of_cell(self.record.get(self.columns.subject).unwrap_or_default().trim())
    }

    fn next_subject(&mut self) -> Result<Option<SubjectRows>, StudyError> {
        if !self.has_record {
            return Ok(None);
        }
        let subject = self.subject().to_owned();
        let mut own = SubjectRows { line: self.line(), rows: Vec::new(), subject };
        while self.has_record && self.subject() == own.subject {
            own.rows.push(self.row()?);
            self.advance()?;
        }
        Ok(Some(own))
    }
}

/// Whether a column of this name is read.
fn is_known(column: &str) -> bool {
    QUANTITIES.contains(&column)
        || ["subject", "velocity_rad_s", "torque_nm", "session", "converged", "fit", EXCLUDED]
            .contains(&column)
}

impl Iterator for StudyTableReader {
    type Item = Result<SubjectRows, StudyError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_subject().transpose()
    }
}

/// A subject's means over the repetitions, by quantity and cell.
#[derive(Debug, Clone, PartialEq)]
pub struct CellMeans {
    values: Vec<[(f64, u32); QUANTITIES.len()]>,
}

impl CellMeans {
    /// The means of `rows` in the cells at `conditions`.
    ///
    /// # Errors
    /// The condition of the first row that is in none of the cells.
    pub fn of<'a>(
        rows: impl Iterator<Item = &'a StudyRow>,
        conditions: &[(f64, f64)],
    ) -> Result<Self, (f64, f64)> {
        let mut values = vec![[(0.0, 0); QUANTITIES.len()]; conditions.len()];
        for row in rows {
            let cell = conditions.iter().position(|own| *own == row.condition).ok_or(row.condition)?;
            for ((sum, count), value) in values[cell].iter_mut().zip(row.values) {
                if let Some(value) = value {
                    *sum += value;
                    *count += 1;
                }
            }
        }
        Ok(Self { values })
    }

    /// Mean of a quantity in a cell; `None` without a value there.
    pub fn mean(&self, quantity: usize, cell: usize) -> Option<f64> {
        let (sum, count) = self.values[cell][quantity];
        (count > 0).then(|| sum / f64::from(count))
    }

    /// Means of a quantity in all cells; `None` if a cell has no value.
    pub fn all(&self, quantity: usize) -> Option<Vec<f64>> {
        (0..self.values.len()).map(|cell| self.mean(quantity, cell)).collect()
    }
}
