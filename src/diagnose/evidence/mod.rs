//! Evidence: the probability of each cause, from one model of the session.
//!
//! | file | content |
//! |---|---|
//! | `gaussian` | integrals and determinants of normal distributions |
//! | `linearisation` | the torque of every trial, linear in what is unknown |
//! | `session_equations` | marginal likelihood of a linear session: random effects, regression, common unknowns |
//! | `free_laws`, `angle_error`, `size_drift`, `session_prior` | priors of everything unknown |
//! | `model_posterior` | optimum, spreads and evidence of one model |
//! | `model_prior`, `model_search` | which models are compared, and what each is held to be before the data |
//! | `rig_knowledge`, `weighed_constants` | what rig trials say of the constants that causes are about |
//! | `used_freedom` | whether a model stays within what its priors declare |
//! | `answer`, `found_law` | from probabilities to causes, sets and the curve of an unknown law |

pub mod angle_error;
pub mod answer;
pub mod found_law;
pub mod free_laws;
pub mod gaussian;
#[cfg(test)]
mod law_tests;
pub mod linearisation;
pub mod model_posterior;
pub mod model_prior;
pub mod model_search;
pub mod rig_knowledge;
pub mod session_equations;
pub mod session_prior;
pub mod size_drift;
pub mod used_freedom;
pub mod weighed_constants;
