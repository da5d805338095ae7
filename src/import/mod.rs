//! Sessions from foreign recordings: a folder of CSV files, a `.mat` file, a Parquet table, EDF, BDF, XDF or C3D, or one long record
//! with a ramp signal.
//!
//! A [`Mapping`] says which column is what, in which unit and with which sign. [`import`] reads the tables, converts them, cuts a
//! long record into trials, finds the onsets and groups speeds and torques into conditions. Nothing is written before
//! [`ImportedSession::write`].

mod byte_cursor;
mod c3d;
mod conditions;
mod cut;
mod edf;
mod error;
mod mapped_signal;
mod mapping;
#[cfg(feature = "matlab")]
mod mat_array;
#[cfg(feature = "matlab")]
mod mat_v5;
#[cfg(feature = "matlab")]
mod mat_v73;
#[cfg(feature = "parquet")]
mod parquet_source;
mod picture;
mod plausible;
mod ramp_candidates;
mod ramp_way;
mod recording;
mod session_build;
mod source_files;
mod source_table;
mod text_encoding;
mod write;
mod xdf;

pub use error::ImportError;
pub use mapped_signal::{MappedSignal, SignalUnit};
pub use mapping::{IMPORT_FORMAT, LongRecord, Mapping, SignalColumns, schema_text};
pub use recording::{Marker, RECORDING_FILES, Recording, TIME_COLUMN};
pub use session_build::{ImportedSession, import};
pub use source_files::{read_recording, read_source};
pub use source_table::SourceTable;
pub use xdf::{RecordedStream, read_recorded};

#[cfg(test)]
mod tests;
