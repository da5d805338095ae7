//! Sessions in the formats of other tools: a BIDS dataset, tidy Parquet tables, .mat files, XDF, NWB.

mod attached_emg;
mod bdf;
mod bids;
mod bids_folder;
mod current_results;
mod error;
mod fit_rows;
mod mat;
mod mat_attached;
mod mat_file;
mod new_file;
#[cfg(feature = "matlab")]
mod nwb;
#[cfg(not(feature = "matlab"))]
#[path = "without_nwb.rs"]
mod nwb;
#[cfg(feature = "parquet")]
mod parquet;
#[cfg(not(feature = "parquet"))]
#[path = "without_parquet.rs"]
mod parquet;
mod record_channels;
mod rows;
mod sidecars;
mod text_columns;
mod trial_times;
mod xdf;
mod xdf_streams;

pub use bids::{Participant, write as write_bids};
pub use error::ExportError;
pub use mat::write as write_mat;
pub use nwb::write as write_nwb;
pub use parquet::write as write_parquet;
pub use rows::Rows;
pub use xdf::write as write_xdf;
