//! Observations: the measured torque and motion of each trial, prepared from a session for the comparison with the model.

pub mod bearing_friction;
pub mod chosen_smoothing;
pub mod covariates;
pub mod further_channels;
pub mod hold_noise;
pub mod input_averaging;
pub mod motion_errors;
pub mod motion_in_steps;
pub mod moving_angle_noise;
pub mod observations;
pub mod onset_samples;
pub mod preprocessing;
pub mod rig_constants;
