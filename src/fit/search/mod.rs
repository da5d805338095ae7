//! Starting values, and the search for the global optimum.

pub mod mechanism_search;
pub mod multistart;
pub mod pilot_search;
pub mod pooled_fit;
pub mod refit_search;
pub mod shrinkage;
pub mod starting_value_search;
