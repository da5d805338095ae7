//! From raw samples to what the fit compares: the filter, the onset, the noise of the hold.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A low-pass filter, as protocols and session files write it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum FilterSpec {
    /// Butterworth low-pass.
    Butterworth {
        /// Order of the filter.
        order: u32,
        /// Cut-off frequency (-3 dB), Hz.
        cutoff_hz: f64,
        /// Applied forwards and backwards.
        #[serde(default)]
        zero_phase: bool,
    },
}
