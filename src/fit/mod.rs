//! The wrist's parameters out of the recorded torque, and how well they are known.

mod data;
mod fitted;
mod inference;
mod model;
mod output;
mod parameters;
mod residuals;
mod search;
mod solver;

pub use data::hold_noise::NoiseSource;
pub use data::preprocessing::{LeftOut, PrepareError, Prepared, PreparedTrial, View, onset_sample};
pub use fitted::fit::{ELASTIC_LIMIT, Fit, STIFFNESS, Weighting, objective};
pub use fitted::uncertainty::{
    Prediction, Uncertainty, covariance, predictions, uncertainties, variance_accounted_for,
};
pub use inference::bootstrap::{BOOTSTRAPPED, Scatter, bootstrap};
pub use inference::profile::{Interval, PROFILED, profiles};
pub use inference::resampling::{NoiseMaker, resampled};
pub use model::specification::{FORMAT as MODEL_FORMAT, Model, ModelError, Scope, Switched, Term, Treatment};
pub use output::estimates::{
    ConditionEstimate, Estimate, QUANTITIES, by_condition, estimates, estimates_alone, simulated,
};
pub use output::result_files::{FIT_FORMAT, Results, WriteError, fit_header, fit_row, write_files};
pub use parameters::parameterisation::{Component, Coordinate, Layout, Link};
pub use residuals::prediction::predict;
pub use residuals::residual_covariance::{covariances, whiteners};
pub use search::extension_search::{Glance, Scout};
pub use search::starting_values::{Guess, looks};
pub use solver::levenberg_marquardt::{Effort, Outcome, Solution, Stop, solve};
pub use solver::normal_equations::{Normal, Objective};

#[cfg(test)]
mod tests;
