//! A value with its interval.

/// A value with the ends of its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Interval {
    /// The value.
    pub value: f64,
    /// Lower end; `None` if unknown.
    pub low: Option<f64>,
    /// Upper end; `None` if unknown.
    pub high: Option<f64>,
}
