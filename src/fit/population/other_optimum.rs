//! The places where a trial may be besides the reported one.

/// Another optimum of a trial.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OtherOptimum {
    /// The six base parameters.
    pub values: [f64; 6],
    /// Its probability, given all trials.
    pub probability: f64,
}
