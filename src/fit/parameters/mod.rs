//! Parameterisation: the coordinates that the optimisation changes, their bounds, and their relation to each trial's parameters.

pub mod component;
pub mod coordinate;
pub mod parameterisation;
pub mod partition;
pub mod starting_values;
