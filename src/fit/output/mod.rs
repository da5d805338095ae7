//! Estimates by trial and by condition, and the files that hold them.

pub mod estimates;
pub mod result_files;
