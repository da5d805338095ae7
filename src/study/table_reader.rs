//! Reading `study.csv` person by person.

use std::fs::File;
use std::path::{Path, PathBuf};

use super::error::StudyError;
use crate::fit::QUANTITIES;

/// A row of `study.csv` as the tables need it.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Which session of the person.
    pub session: u32,
    /// Velocity, rad/s, and torque, N m.
    pub condition: (f64, f64),
    /// The values of [`QUANTITIES`]; none of a fit that did not converge.
    pub values: [Option<f64>; QUANTITIES.len()],
}

/// All rows of a person.
#[derive(Debug, Clone, PartialEq)]
pub struct PersonRows {
    /// Who.
    pub subject: String,
    /// Line of the first row.
    pub line: u64,
    /// The rows.
    pub rows: Vec<Row>,
}

/// The persons in a table, one after the other; only one is in memory.
pub struct Rows {
    file: PathBuf,
    reader: csv::Reader<File>,
    columns: Columns,
    record: csv::StringRecord,
    more: bool,
}

struct Columns {
    subject: usize,
    velocity: usize,
    torque: usize,
    session: Option<usize>,
    converged: Option<usize>,
    quantities: [Option<usize>; QUANTITIES.len()],
}

impl Rows {
    /// Opens a table. Columns beside `subject`, `velocity_rad_s` and `torque_nm` may be missing, and so have no values.
    pub fn open(file: &Path) -> Result<Self, StudyError> {
        let wrong = |line: u64, message: String| StudyError::Table { file: file.to_owned(), line, message };
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .from_path(file)
            .map_err(|error| wrong(1, error.to_string()))?;
        let header = reader.headers().map_err(|error| wrong(1, error.to_string()))?.clone();
        let find = |name: &str| header.iter().position(|column| column.trim() == name);
        let must = |name: &str| {
            let expected =
                || wrong(1, format!("column {name} is missing; expected the study.csv of a study"));
            find(name).ok_or_else(expected)
        };
        let columns = Columns {
            subject: must("subject")?,
            velocity: must("velocity_rad_s")?,
            torque: must("torque_nm")?,
            session: find("session"),
            converged: find("converged"),
            quantities: QUANTITIES.map(find),
        };
        let mut rows =
            Self { file: file.to_owned(), reader, columns, record: csv::StringRecord::new(), more: true };
        rows.step()?;
        Ok(rows)
    }

    fn step(&mut self) -> Result<(), StudyError> {
        self.more = self.reader.read_record(&mut self.record).map_err(|error| StudyError::Table {
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
        StudyError::Table {
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

    fn row(&self) -> Result<Row, StudyError> {
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
        Ok(Row { session, condition: (velocity, torque), values })
    }

    fn next_person(&mut self) -> Result<Option<PersonRows>, StudyError> {
        if !self.more {
            return Ok(None);
        }
        let subject = self.record.get(self.columns.subject).unwrap_or_default().trim().to_owned();
        let mut person = PersonRows { line: self.line(), rows: Vec::new(), subject };
        while self.more && self.record.get(self.columns.subject).unwrap_or_default().trim() == person.subject
        {
            person.rows.push(self.row()?);
            self.step()?;
        }
        Ok(Some(person))
    }
}

impl Iterator for Rows {
    type Item = Result<PersonRows, StudyError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.next_person().transpose()
    }
}

/// A person's means over the repetitions, by quantity and cell; `None` where there is no value.
#[derive(Debug, Clone, PartialEq)]
pub struct Cells {
    values: Vec<[(f64, u32); QUANTITIES.len()]>,
}

impl Cells {
    /// The means of `rows` in the cells at `conditions`; a row in none of them is given back.
    pub fn of<'a>(
        rows: impl Iterator<Item = &'a Row>,
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

    /// The mean of a quantity in a cell.
    pub fn mean(&self, quantity: usize, cell: usize) -> Option<f64> {
        let (sum, count) = self.values[cell][quantity];
        (count > 0).then(|| sum / f64::from(count))
    }

    /// The means of a quantity in all cells, if none lacks one.
    pub fn all(&self, quantity: usize) -> Option<Vec<f64>> {
        (0..self.values.len()).map(|cell| self.mean(quantity, cell)).collect()
    }
}
