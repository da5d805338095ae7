//! What is held plausible of a mechanism's parameter before any data.

/// Prior distribution of a parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Prior {
    /// Normal distribution, for a parameter of either sign.
    Normal {
        /// Mean, in the parameter's unit.
        mean: f64,
        /// Standard deviation, in the parameter's unit.
        sd: f64,
    },
    /// Upper half of a normal distribution, for a size whose lower bound means no effect.
    HalfNormal {
        /// Standard deviation of the distance above the value without effect, in the parameter's unit.
        sd: f64,
    },
    /// Normal distribution of the logarithm, for a parameter whose lower bound is above zero.
    LogNormal {
        /// Median, in the parameter's unit.
        median: f64,
        /// Standard deviation of the natural logarithm.
        log_sd: f64,
    },
}
