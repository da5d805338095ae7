//! What errors of the rig's constants do to the estimates: measured ones through their covariance, assumed ones by what-if fits.

pub mod assumed_constants;
pub mod constant_effects;
