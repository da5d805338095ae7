//! The constants of the rig, from trials without a person: lever, gains, delay, filter, servo and friction, with their covariance.
//!
//! ```text
//! rig trials -> prepared_rig     Fourier coefficients of each trial, noise at rest, errors of the encoder
//!            -> input_check      whether the records can be those of the loads, units and signs in the table
//!            -> rig_model        what the model of the rig predicts at each frequency
//!            -> moments          products of the residual with motions that follow from the target alone
//!            -> fit              joint fit of all constants to all trials
//!            -> starts           fits from several starts; likelihood says which one is right
//!            -> presliding       whether the trials show a bearing that gives before it slides
//!            -> low_pass         whether a low-pass that is hardly told beside a delay is one
//!            -> covariance       noise, steps of the encoder, scatter of whole trials
//!            -> reported, misfit, loads
//!            -> following        whether the recorded angle is the motor's, or the target
//!            -> sound_rig        how far the constants are from those of a sound rig, which is evidence for causes too
//!            -> stated_rig       whether that tells a load whose stated value is wrong
//!            -> calibration, comparison
//! ```

mod calibration;
mod comparison;
mod constants;
mod covariance;
mod encoder;
mod error;
mod fit;
mod following;
mod fourier;
mod input_check;
mod likelihood;
mod linear_algebra;
mod loads;
mod low_pass;
mod misfit;
mod moments;
mod noise;
mod output;
mod prepared_rig;
mod prepared_trial;
mod presliding;
mod reported;
mod rig_contradiction;
mod rig_deviations;
mod rig_model;
mod sound_rig;
mod starts;
mod stated_rig;

pub use calibration::{CalibrationOutcome, calibrate};
pub use comparison::{
    DIFFERENCE_LEVEL, QuantityDifference, RigComparison, RigVerdict, UNEXPLAINED_LEVEL, compare,
};
pub use constants::{PRESLIDING_FACTOR, PRESLIDING_RAD};
pub use error::CalibrateError;
pub use loads::LoadCheck;
pub use misfit::{LoadResidual, RigMisfit};
pub use noise::PowerSpectrum;
pub use rig_contradiction::{RigContradiction, named_load};
pub use rig_deviations::{RigDeviations, ToldConstant};
pub use sound_rig::{CAUSED, RigFaults, SOUND_DELAY_S, servo_bandwidth_hz};
pub use stated_rig::LoadByRig;

#[cfg(test)]
mod tests;
