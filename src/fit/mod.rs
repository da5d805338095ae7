//! The wrist's parameters out of the recorded torque, and how well they are known.

mod alone;
mod bootstrap;
mod estimates;
mod first_look;
mod guess;
mod layout;
mod lean;
mod model;
mod motion;
mod noise;
mod normal;
mod predict;
mod prepare;
mod profile;
mod resample;
mod results;
mod rival;
mod run;
mod second_look;
mod solve;
mod uncertainty;
mod weights;

pub use bootstrap::{BOOTSTRAPPED, Scatter, bootstrap};
pub use estimates::{
    ConditionEstimate, Estimate, QUANTITIES, by_condition, estimates, estimates_alone, simulated,
};
pub use guess::{Guess, looks};
pub use layout::{Component, Coordinate, Layout, Link};
pub use model::{FORMAT as MODEL_FORMAT, Model, ModelError, Scope, Switched, Term, Treatment};
pub use noise::NoiseSource;
pub use normal::{Normal, Objective};
pub use predict::predict;
pub use prepare::{LeftOut, PrepareError, Prepared, PreparedTrial, View, onset_sample};
pub use profile::{Interval, PROFILED, profiles};
pub use resample::{NoiseMaker, resampled};
pub use results::{FIT_FORMAT, Results, WriteError, fit_header, fit_row, write_files};
pub use rival::{Glance, Scout};
pub use run::{ELASTIC_LIMIT, Fit, STIFFNESS, Weighting, objective};
pub use solve::{Effort, Outcome, Solution, Stop, solve};
pub use uncertainty::{
    Prediction, Uncertainty, covariance, predictions, uncertainties, variance_accounted_for,
};
pub use weights::{covariances, whiteners};

#[cfg(test)]
mod tests;
