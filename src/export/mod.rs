//! Sessions in the formats of other tools: a BIDS dataset, tidy Parquet tables.

mod bdf;
mod bids;
mod error;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(not(feature = "parquet"))]
#[path = "without_parquet.rs"]
mod parquet;
mod rows;
mod sidecars;

pub use bids::{Participant, write as write_bids};
pub use error::ExportError;
pub use parquet::write as write_parquet;
pub use rows::Rows;
