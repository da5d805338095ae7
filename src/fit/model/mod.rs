//! The fit model as an experimenter specifies it.

pub mod specification;
