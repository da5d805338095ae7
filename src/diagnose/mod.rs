//! What the model gets wrong in measured data, why, and what mending it gains.
//!
//! The paper's filter hides most of what a wrong model does ([`Look`]), so a diagnosis looks through a wider one.
//! Residuals are judged in units of the noise that the holds show, after the free parameters have absorbed what they can
//! (`residual_projection`). Within the trace, every mechanism of the catalogue is probed (`score_test`), a pattern without a name is
//! looked for besides (`lack_of_fit`), and both are compared with simulated sessions in which nothing is wrong
//! (`null_distribution`). What stands out is refitted in full, and rivals that could pass for it are named with it (`candidates`).
//! Then the trials are compared with each other (`across_trials`). Steps are repeated until nothing is left over.

mod across_trials;
#[cfg(test)]
mod added_mechanism;
mod applicability;
mod cause;
mod diagnosis;
mod mains_hum;
mod output;
mod predicted_torque;
mod preprocessing;
mod protocol_design;
mod residual_correlation;
mod within_trial;

pub use across_trials::covariate_regression::Trend;
pub use across_trials::elastic_limit_law::{Law, LimitLaw};
pub use across_trials::outliers::Outlier;
pub use cause::{Cause, Evidence};
pub use diagnosis::{Diagnosis, Verdict, diagnose};
pub use mains_hum::{Hum, without as without_hum};
pub use output::{DIAGNOSIS_FORMAT, picture};
pub use preprocessing::Look;
pub use protocol_design::{Proposal, design};
pub use within_trial::cross_validation::{Gain, Ratio};
pub use within_trial::score_test::Unseen;
