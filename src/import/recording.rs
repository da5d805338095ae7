//! A recording of another device: its tables, and the markers in it.

use super::source_table::SourceTable;

/// The files that recordings are read from.
pub const RECORDING_FILES: &str = "a .csv, .txt, .tsv, .mat, .parquet, .edf, .bdf, .xdf or .c3d file";

/// Name of the column of time in tables of formats that have a clock of their own, s.
pub const TIME_COLUMN: &str = "time_s";

/// A recording.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Recording {
    /// Tables of numbers, one for each rate or stream.
    pub tables: Vec<SourceTable>,
    /// Markers, in the order of the file.
    pub markers: Vec<Marker>,
}

/// A text at a time.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Time on the clock of the tables, s.
    pub time_s: f64,
    /// The text.
    pub text: String,
}
