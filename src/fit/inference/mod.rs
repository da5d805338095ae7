//! Intervals beyond standard errors: profile likelihood and parametric bootstrap.

pub mod bootstrap;
pub mod profile;
pub mod resampling;
