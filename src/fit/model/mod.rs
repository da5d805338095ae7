//! The fit model: which mechanisms it has, and over which trials each parameter is shared.

pub mod model_file;
pub mod parameter_index;
pub mod specification;
