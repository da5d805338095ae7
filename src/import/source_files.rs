//! Reading the files of a source into tables.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::error::ImportError;
use super::recording::Recording;
use super::source_table::SourceTable;
use super::text_encoding::text_of;
use super::{c3d, edf, xdf};
use crate::files::{self, Folder, limits};

/// What is read: `RECORDING_FILES`, and folders of them.
const KINDS: &str =
    "a folder of such files, or a .csv, .txt, .tsv, .mat, .parquet, .edf, .bdf, .xdf or .c3d file";

/// Reads the tables of `source`: one of each file of a folder, in the order of their names and numbers; of a .mat file with matrices one of each of their columns.
///
/// # Errors
/// If the source cannot be read, or is of no kind that is known.
pub fn read_source(source: &Path) -> Result<Vec<SourceTable>, ImportError> {
    let unreadable = |source_error| ImportError::Unreadable { path: source.into(), source: source_error };
    let folder = match Folder::open(source) {
        Err(error) if error.kind() == ErrorKind::NotADirectory => return read_file(source),
        opened => opened.map_err(unreadable)?,
    };
    let entries = folder.entries().map_err(unreadable)?;
    let mut recordings: Vec<PathBuf> =
        entries.into_iter().map(|entry| folder.path_of(entry.name)).filter(|path| is_known(path)).collect();
    // Trial 10 was run after trial 9.
    recordings.sort_by(|a, b| natord::compare(&a.to_string_lossy(), &b.to_string_lossy()));
    let mut tables = Vec::new();
    for file in recordings {
        tables.extend(read_file(&file)?);
    }
    if tables.is_empty() {
        return Err(ImportError::Source {
            path: source.into(),
            found: "a folder without tables".into(),
            expected: KINDS,
        });
    }
    Ok(tables)
}

/// Reads one file with its tables and markers.
///
/// # Errors
/// As [`read_source`].
pub fn read_recording(file: &Path) -> Result<Recording, ImportError> {
    match extension(file).as_str() {
        "edf" | "bdf" => read_stamped(file, edf::is_edf, edf::read),
        "xdf" => read_stamped(file, xdf::is_xdf, xdf::read),
        "c3d" => read_stamped(file, c3d::is_c3d, c3d::read),
        _ => Ok(Recording { tables: read_file(file)?, markers: Vec::new() }),
    }
}

/// Reads a file whose format has a clock of its own.
fn read_stamped(
    path: &Path,
    is_of_kind: fn(&[u8]) -> bool,
    read: fn(&[u8], &Path) -> Result<Recording, ImportError>,
) -> Result<Recording, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.into(), source };
    let bytes = files::read(path, limits::RECORDING_BYTES).map_err(unreadable)?;
    if !is_of_kind(&bytes) {
        return Err(ImportError::Source {
            path: path.into(),
            found: "a file that does not begin as its name says".into(),
            expected: "an EDF, BDF, XDF or C3D file",
        });
    }
    read(&bytes, path)
}

fn extension(path: &Path) -> String {
    path.extension().unwrap_or_default().to_string_lossy().to_lowercase()
}

fn is_known(path: &Path) -> bool {
    ["csv", "txt", "tsv", "mat", "parquet", "edf", "bdf", "xdf", "c3d"].contains(&extension(path).as_str())
}

fn read_file(path: &Path) -> Result<Vec<SourceTable>, ImportError> {
    match extension(path).as_str() {
        "csv" | "txt" | "tsv" => Ok(vec![read_text_table(path)?]),
        "mat" => read_mat(path),
        "parquet" => read_parquet(path),
        "edf" | "bdf" | "xdf" | "c3d" => Ok(read_recording(path)?.tables),
        _ => Err(ImportError::Source {
            path: path.into(),
            found: "a file of another kind".into(),
            expected: KINDS,
        }),
    }
}

#[cfg(feature = "matlab")]
fn read_mat(path: &Path) -> Result<Vec<SourceTable>, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.into(), source };
    let bytes = files::read(path, limits::RECORDING_BYTES).map_err(unreadable)?;
    let arrays = if super::mat_v73::is_hdf5(&bytes) {
        super::mat_v73::read(bytes, path)?
    } else {
        super::mat_v5::read(&bytes, path)?
    };
    super::mat_array::tables(path, arrays)
}

#[cfg(not(feature = "matlab"))]
fn read_mat(path: &Path) -> Result<Vec<SourceTable>, ImportError> {
    Err(ImportError::Source {
        path: path.into(),
        found: "a .mat file, and this program was built without the feature matlab".into(),
        expected: "another kind, or a program built with: cargo build --release --features matlab",
    })
}

#[cfg(feature = "parquet")]
fn read_parquet(path: &Path) -> Result<Vec<SourceTable>, ImportError> {
    super::parquet_source::read(path)
}

#[cfg(not(feature = "parquet"))]
fn read_parquet(path: &Path) -> Result<Vec<SourceTable>, ImportError> {
    Err(ImportError::Source {
        path: path.into(),
        found: "a Parquet file, and this program was built without the feature parquet".into(),
        expected: "another kind, or a program built with: cargo build --release --features parquet",
    })
}

/// Reads a table with a header line; the separator is what the header has most of: comma, semicolon or tab.
fn read_text_table(path: &Path) -> Result<SourceTable, ImportError> {
    let unreadable = |source| ImportError::Unreadable { path: path.into(), source };
    let text = text_of(files::read(path, limits::RECORDING_BYTES).map_err(unreadable)?);
    let head = text.lines().next().unwrap_or_default();
    let separator =
        [b',', b';', b'\t'].into_iter().max_by_key(|one| head.bytes().filter(|byte| byte == one).count());
    let mut reader = csv::ReaderBuilder::new()
        .delimiter(separator.unwrap_or(b','))
        .trim(csv::Trim::All)
        .from_reader(text.as_bytes());
    let broken = |error: csv::Error| ImportError::Source {
        path: path.into(),
        found: format!("no table ({error})"),
        expected: "a header line, and in every row as many cells as in the header",
    };
    let names: Vec<String> = reader.headers().map_err(broken)?.iter().map(str::to_owned).collect();
    let mut columns: Vec<(String, Vec<f64>)> = names.into_iter().map(|name| (name, Vec::new())).collect();
    for row in reader.records() {
        let row = row.map_err(broken)?;
        let line = row.position().map_or(1, csv::Position::line);
        for ((column, values), cell) in columns.iter_mut().zip(row.iter()) {
            let refused = || ImportError::Cell {
                path: path.into(),
                line,
                column: column.clone(),
                found: cell.to_owned(),
            };
            // A decimal comma is common where the separator is none; where it is, a comma in a number divides thousands, or nobody knows.
            let number = match cell.parse() {
                Ok(number) => number,
                Err(_) if separator == Some(b',') => return Err(refused()),
                Err(_) => cell.replace(',', ".").parse().map_err(|_| refused())?,
            };
            values.push(number);
        }
    }
    Ok(SourceTable::new(path.display().to_string(), columns))
}
