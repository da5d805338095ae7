//! Measured data: from a session to the torque and motion that are compared with the model.

pub mod hold_noise;
pub mod input_averaging;
pub mod preprocessing;
