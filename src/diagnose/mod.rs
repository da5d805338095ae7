//! What the model gets wrong in measured data, why, and what mending it gains.
//!
//! The paper's filter hides most of what a wrong model does ([`Look`]), so a diagnosis looks through a wider one.
//! Residuals are judged in units of the noise that the holds show, after the free parameters have absorbed what they can
//! (`tangent`). Within the trace, every mechanism of the catalogue is probed (`screen`), a pattern without a name is
//! looked for besides (`omnibus`), and both are compared with simulated sessions in which nothing is wrong
//! (`calibrate`). What stands out is refitted in full, and rivals that could pass for it are named with it (`refit`).
//! Then the trials are compared with each other (`across`, `trend`, `outliers`). Steps are repeated until nothing is left over.

mod across;
mod by_trial;
mod calibrate;
mod cause;
mod design;
mod gain;
mod hum;
mod law;
mod limit_law;
mod look;
mod omnibus;
mod outliers;
mod output;
mod refit;
mod rest;
mod screen;
mod search;
mod steps;
mod tangent;
mod trend;

pub use cause::{Cause, Evidence};
pub use design::{Proposal, design};
pub use gain::{Gain, Ratio};
pub use hum::{Hum, without as without_hum};
pub use limit_law::{Law, LimitLaw};
pub use look::Look;
pub use outliers::Outlier;
pub use output::{DIAGNOSIS_FORMAT, picture};
pub use screen::Unseen;
pub use search::{Diagnosis, Verdict, diagnose};
pub use trend::Trend;
