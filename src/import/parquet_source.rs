//! Reads the numeric columns of a Parquet table.

use std::path::Path;

use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};

use super::error::ImportError;
use super::source_table::SourceTable;
use crate::files::{self, FileRefusal, limits};

/// Reads the table in `path`; columns that are not numbers in every row are listed as not usable.
pub fn read(path: &Path) -> Result<Vec<SourceTable>, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.into(), source };
    // The library reads the file itself, in pieces.
    let file = files::open(path).map_err(unreadable)?;
    if file.metadata().map_err(unreadable)?.len() > limits::RECORDING_BYTES {
        return Err(unreadable(FileRefusal::TooLarge { limit: limits::RECORDING_BYTES }.into()));
    }
    let broken = |error: ParquetError| ImportError::Source {
        path: path.into(),
        found: format!("no Parquet table that can be read ({error})"),
        expected: "a flat table, uncompressed or compressed with Snappy",
    };
    let reader = SerializedFileReader::new(file).map_err(broken)?;
    let mut columns: Vec<ParquetColumn> = Vec::new();
    for (row, fields) in reader.get_row_iter(None).map_err(broken)?.enumerate() {
        add(&mut columns, row + 1, &fields.map_err(broken)?);
    }
    let mut table = SourceTable::new(path.display().to_string(), Vec::new());
    for column in columns {
        match column.why_not {
            Some(reason) => table.unusable.push((column.name, reason)),
            None => table.columns.push((column.name, column.values)),
        }
    }
    Ok(vec![table])
}

/// A column while it is read.
struct ParquetColumn {
    name: String,
    values: Vec<f64>,
    /// The first row that is no number, and what it is.
    why_not: Option<String>,
}

fn add(columns: &mut Vec<ParquetColumn>, number: usize, row: &Row) {
    let is_first = columns.is_empty();
    for (place, (name, field)) in row.get_column_iter().enumerate() {
        if is_first {
            columns.push(ParquetColumn { name: name.clone(), values: Vec::new(), why_not: None });
        }
        let column = &mut columns[place];
        match value(field) {
            Ok(value) => column.values.push(value),
            Err(what) if column.why_not.is_none() => {
                column.why_not = Some(format!("row {number} is {what}"));
            }
            Err(_) => {}
        }
    }
}

/// The number of a field, or what it is instead and what to do.
fn value(field: &Field) -> Result<f64, &'static str> {
    Ok(match field {
        Field::Double(value) => *value,
        Field::Float(value) => f64::from(*value),
        Field::Int(value) => f64::from(*value),
        Field::Short(value) => f64::from(*value),
        Field::Byte(value) => f64::from(*value),
        Field::UInt(value) => f64::from(*value),
        Field::UShort(value) => f64::from(*value),
        Field::UByte(value) => f64::from(*value),
        Field::Long(value) => *value as f64,
        Field::ULong(value) => *value as f64,
        Field::Bool(value) => f64::from(u8::from(*value)),
        Field::Null => return Err("empty; remove the row, or write a number in every row"),
        Field::Date(_) | Field::TimestampMillis(_) | Field::TimestampMicros(_) => {
            return Err("a date or a time of day; write times as a number of seconds");
        }
        Field::Str(_) | Field::Bytes(_) => return Err("a text; write numbers"),
        _ => return Err("no number; write numbers, one in every row"),
    })
}
