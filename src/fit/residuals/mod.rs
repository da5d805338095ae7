//! Residuals: predicted torque, the covariance of the residuals, and the objective function.

pub mod channel_covariance;
pub mod input_error;
pub mod objective;
pub mod prediction;
pub mod residual_covariance;
