//! Diagnosis of a fit: does the model misfit the data, which mechanism of the catalogue explains it, and what does adding it gain.
//!
//! The paper's filter hides most effects of a wrong model, so the diagnosis preprocesses the session with a wider one (`preprocessing`)
//! and removes mains hum (`mains_hum`).
//!
//! Within the trials (`within_trial`), residuals are whitened by the noise of the holds and projected onto what the free parameters
//! cannot absorb (`residual_projection`). Every mechanism has a score (`score_test`), a lack-of-fit test looks for any other pattern
//! (`lack_of_fit`), and both are compared with simulated sessions without misfit (`null_distribution`). If the misfit is significant,
//! each mechanism is added to the model and fitted (`candidates`); the best is kept (`forward_selection`) if it improves trials left out
//! of the fit (`cross_validation`), and mechanisms that could be mistaken for it are named with it (`confusability`, `discrepancy`).
//!
//! Across the trials (`across_trials`), the fitted stiffnesses are tested for outliers and for effects of covariates, and the elastic
//! limits for their dependence on velocity. `diagnosis` runs all of it and decides the verdict; `protocol_design` proposes the protocol
//! that best separates causes which remain indistinguishable.

mod across_trials;
#[cfg(test)]
mod added_mechanism;
mod applicability;
mod base_model;
mod cause;
mod diagnosis;
mod mains_hum;
mod output;
mod predicted_torque;
mod preprocessing;
mod protocol_design;
mod residual_correlation;
mod within_trial;

pub use across_trials::covariate_regression::CovariateEffect;
pub use across_trials::elastic_limit_law::{ElasticLimitLaw, LimitForm};
pub use across_trials::outliers::Outlier;
pub use cause::{Cause, CauseEvidence};
pub use diagnosis::{Diagnosis, Verdict, diagnose};
pub use mains_hum::{DetectedHum, remove_hum};
pub use output::{DIAGNOSIS_FORMAT, picture};
pub use preprocessing::DiagnosisInput;
pub use protocol_design::{ProtocolProposal, propose_protocols};
pub use within_trial::cross_validation::{Gain, Ratio};
pub use within_trial::score_test::UndetectableMechanism;
