//! A parameter of a mechanism.

use super::prior::Prior;

/// Name, meaning and bounds of a parameter of a mechanism.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MechanismParameter {
    /// Name with unit, as in results and in model files.
    pub name: &'static str,
    /// Meaning, in a few words.
    pub meaning: &'static str,
    /// Lower bound in a fit.
    pub low: f64,
    /// Upper bound in a fit.
    pub high: f64,
    /// The value at which the mechanism has no effect; `None` if it has none only in a limit.
    pub absent: Option<f64>,
    /// A plausible value.
    pub typical: f64,
    /// What is held plausible of it before any data; see [`Mechanism::prior`](super::Mechanism::prior).
    pub prior: Prior,
    /// Whether least squares estimates it together with the base parameters.
    pub fitted: bool,
}

impl MechanismParameter {
    /// A parameter that least squares estimates, with the bounds `range` (low, high).
    pub const fn new(
        name: &'static str,
        meaning: &'static str,
        range: (f64, f64),
        absent: Option<f64>,
        typical: f64,
        prior: Prior,
    ) -> Self {
        Self { name, meaning, low: range.0, high: range.1, absent, typical, prior, fitted: true }
    }
}
