//! Diagnosis of a fit: does the model misfit the data, which mechanism of the catalogue explains it, and what does adding it gain.
//!
//! The paper's filter hides most effects of a wrong model, so the diagnosis preprocesses the session with a wider one (`preprocessing`)
//! and removes mains hum (`mains_hum`).
//!
//! `evidence` compares models: none of the causes, each mechanism of the catalogue, pairs of them, and unknown laws at each place of the
//! model. Each has a posterior probability, from which causes, sets and the verdict follow.
//!
//! The best model is checked: `within_trial` compares what it leaves with simulated sessions (`null_distribution`), in the direction of
//! every mechanism (`score_test`) and of any other pattern (`lack_of_fit`); `across_trials` asks whether trials still go with order, rest
//! or EMG. `cross_validation` measures what a cause gains on trials left out of the fit.
//!
//! `diagnosis` runs all of it and decides the verdict, `fit_chain` says what each cause gains; `protocol_design` proposes the protocol, rig trials or sensor that separate causes which remain
//! indistinguishable.

mod across_trials;
#[cfg(test)]
mod added_mechanism;
mod applicability;
mod base_model;
mod cause;
mod diagnosis;
mod evidence;
mod fit_chain;
mod interval;
mod mains_hum;
mod output;
mod predicted_torque;
mod preprocessing;
mod protocol_design;
mod residual_correlation;
#[cfg(test)]
mod test_session;
mod within_trial;

pub use across_trials::covariate_regression::CovariateEffect;
pub use across_trials::elastic_limit_law::{ElasticLimitLaw, LimitForm};
pub use across_trials::outliers::Outlier;
pub use cause::{AlternativeCause, Cause, CauseEvidence};
pub use diagnosis::{Diagnosis, Verdict, diagnose};
pub use evidence::answer::CauseProbabilities;
pub use evidence::found_law::{FoundLaw, LawCheck};
pub use evidence::rig_knowledge::RigKnowledge;
pub use interval::Interval;
pub use mains_hum::{DetectedHum, remove_hum};
pub use output::{DIAGNOSIS_FORMAT, picture};
pub use preprocessing::DiagnosisInput;
pub use protocol_design::{Needs, Proposal, ProposedChange, inseparable, propose, worthwhile};
pub use within_trial::cross_validation::{Gain, Ratio};
pub use within_trial::score_test::UndetectableMechanism;
