//! Intervals beyond standard errors: profile likelihood, and the parametric bootstrap.

pub mod bootstrap;
pub mod profile;
pub mod resampling;
