//! Fit: estimates the parameters of the wrist model from recorded torque, with their uncertainty.
//!
//! The folders are layers; a file imports only files of its own layer and of the layers above it in this list.
//!
//! | layer | content |
//! |---|---|
//! | `linalg` | factorisation and inversion of small matrices |
//! | `data` | preprocessing: from a session to observations and their noise |
//! | `model` | specification of a fit model, its file, and the indices of the parameters |
//! | `parameters` | starting values and bounds, coordinates, their partition into components and blocks |
//! | `residuals` | predicted torque, covariance of the residuals, objective and whitening |
//! | `solver` | normal equations in arrowhead form, Levenberg-Marquardt method |
//! | `fitted` | [`Fit`], its predictions and standard errors, fits that start at its optimum, block subproblems |
//! | `search` | starting values, multistart, shrinkage, starts of an added mechanism |
//! | `population` | the model of a session: spreads and regression of the trials' parameters, and the fit with it |
//! | `pipeline` | [`Fit::new`]: all steps for one session |
//! | `inference` | profile likelihood, parametric bootstrap |
//! | `calibration` | what errors of the rig's constants do to the estimates |
//! | `output` | estimates by trial and condition, result files |

mod bordered;
mod calibration;
mod data;
mod fitted;
mod inference;
mod linalg;
mod model;
mod noise_from_residuals;
mod output;
mod parameters;
mod pipeline;
mod population;
mod residuals;
mod search;
mod solver;
#[cfg(test)]
mod tests;

pub use calibration::asked_fit::AskedFit;
pub use calibration::assumed_constants::{ASSUMED_ERROR, AssumedConstant};
pub use calibration::constant_effects::ConstantEffects;
pub use data::bearing_friction::FrictionLaw;
pub use data::observations::{EmgGaps, ExcludedTrial, NoiseSource, Observations, TrialObservation};
pub use data::onset_samples::onset_sample;
pub use data::preprocessing::{PreprocessingError, PreprocessingSettings};
pub use data::rig_constants::{CalibrationMisuse, RigConstants};
pub use fitted::fit::Fit;
pub use fitted::predictions::{Prediction, predictions, variance_accounted_for};
pub use fitted::quantities::{QUANTITIES, simulated_trajectory};
pub use fitted::uncertainty::{Uncertainty, coordinate_covariances, uncertainties};
pub use inference::bootstrap::{BOOTSTRAPPED_QUANTITIES, BootstrapSpread, bootstrap, bootstrap_watched};
pub use inference::profile::{PROFILED_PARAMETERS, ProfileInterval, profiles};
pub use inference::resampling::{NoiseSampler, draw_observations};
pub use model::model_file::{MODEL_FORMAT, ModelError};
pub use model::parameter_index::{B_H, I_J, K_DEC, K_H, K_SRS, X_E};
pub use model::specification::{AddedMechanism, LawTerm, Model, ParameterSpec, Scope, mechanism_ranges};
pub use output::estimates::{
    ConditionEstimate, TrialEstimate, by_condition, conditions_with, estimates, estimates_without_profiles,
    session_estimates, torque_falls, with_rig_errors,
};
pub use output::result_files::{
    DESCRIBING_VAF, FIT_FORMAT, Results, WriteError, best_vaf, fit_header, fit_row, onset_warnings,
    plain_warning, reflex_warning, write_files,
};
pub use parameters::component::{Component, Position};
pub use parameters::coordinate::{Coordinate, Transform};
pub use parameters::parameterisation::Parameterisation;
pub use parameters::starting_values::StartingValues;
pub use population::hierarchy::Hierarchy;
pub use population::no_session_model::NoSessionModel;
pub use population::other_optimum::OtherOptimum;
pub use population::session_fit::{SessionFit, coarse_angle};
pub use population::session_priors::{DECREMENT_RATIO, EXPONENT_SD, LEVEL_SD, SPREAD_DEGREES, SPREAD_SD};
pub use residuals::input_error::common_input_error_covariance;
pub use residuals::objective::{Objective, Weighting};
pub use residuals::prediction::predict;
pub use residuals::residual_covariance::precision_factors;
pub use search::mechanism_search::{MechanismSearch, ScreenedMechanism, StartedMechanism};
pub use search::refit_search::RefitSearch;
pub use search::starting_value_search::StartingValueSearch;
pub use solver::levenberg_marquardt::{ComponentOutcome, Solution, Termination, solve};
pub use solver::normal_equations::GaussNewtonEquations;
pub use solver::options::SolverOptions;
