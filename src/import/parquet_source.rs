//! Reads the numeric columns of a Parquet table.

use std::path::Path;

use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};
use parquet::record::{Field, Row};

use super::error::ImportError;
use super::source_table::SourceTable;
use crate::files::{self, FileRefusal, limits};

/// Reads the table in `path`; columns that are not numbers are left out.
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
    let mut columns: Vec<(String, Vec<Option<f64>>)> = Vec::new();
    for row in reader.get_row_iter(None).map_err(broken)? {
        add(&mut columns, &row.map_err(broken)?);
    }
    let whole = |(name, values): (String, Vec<Option<f64>>)| {
        Some((name, values.into_iter().collect::<Option<Vec<f64>>>()?))
    };
    let columns = columns.into_iter().filter_map(whole).collect();
    Ok(vec![SourceTable { name: path.display().to_string(), columns }])
}

fn add(columns: &mut Vec<(String, Vec<Option<f64>>)>, row: &Row) {
    let is_first = columns.is_empty();
    for (place, (name, field)) in row.get_column_iter().enumerate() {
        if is_first {
            columns.push((name.clone(), Vec::new()));
        }
        columns[place].1.push(number(field));
    }
}

fn number(field: &Field) -> Option<f64> {
    Some(match field {
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
        _ => return None,
    })
}
