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
pub use data::preprocessing::{
    ExcludedTrial, Observations, PreprocessingError, PreprocessingSettings, TrialObservation, onset_sample,
};
pub use fitted::fit::{Fit, K_SRS, Weighting, X_E, objective};
pub use fitted::uncertainty::{
    Prediction, Uncertainty, covariance, predictions, uncertainties, variance_accounted_for,
};
pub use inference::bootstrap::{BOOTSTRAPPED_QUANTITIES, BootstrapSpread, bootstrap};
pub use inference::profile::{PROFILED_PARAMETERS, ProfileInterval, profiles};
pub use inference::resampling::{NoiseSampler, draw_observations};
pub use model::specification::{
    AddedMechanism, FORMAT as MODEL_FORMAT, LawTerm, Model, ModelError, ParameterSpec, Scope,
};
pub use output::estimates::{
    ConditionEstimate, QUANTITIES, TrialEstimate, by_condition, estimates, estimates_without_profiles,
    simulated,
};
pub use output::result_files::{FIT_FORMAT, Results, WriteError, fit_header, fit_row, write_files};
pub use parameters::parameterisation::{Component, Coordinate, Parameterisation, Transform};
pub use residuals::prediction::predict;
pub use residuals::residual_covariance::{covariances, whiteners};
pub use search::extension_search::{ExtensionSearch, ScreenedExtension};
pub use search::starting_values::{StartingValues, pilot_points};
pub use solver::levenberg_marquardt::{ComponentOutcome, Solution, SolverOptions, Termination, solve};
pub use solver::normal_equations::{NormalEquations, Objective};

#[cfg(test)]
mod tests;
