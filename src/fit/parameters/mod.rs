//! From the fit model to the coordinates that the optimisation changes.

pub mod parameterisation;
