//! Misfit within the trials' torque traces: is there any, which mechanisms explain it, and what does adding them gain.

pub mod cross_validation;
pub mod lack_of_fit;
pub mod null_distribution;
pub mod residual_projection;
pub mod residual_terms;
pub mod score_test;
pub mod tested_fit;
