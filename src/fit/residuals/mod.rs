//! Predicted torque, the covariance of the residuals, and the objective function.

pub mod prediction;
pub mod residual_covariance;
