//! Sessions in the formats of other tools: a BIDS dataset, tidy Parquet tables.

mod bdf;
mod bids;
mod error;
mod parquet;
mod sidecars;

pub use bids::{Participant, write as write_bids};
pub use error::ExportError;
pub use parquet::{Rows, write as write_parquet};
