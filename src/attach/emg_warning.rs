//! What to know of attached EMG before it is trusted.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::clipping::ClippedEmg;
use super::event_match::CLOCK_TOLERANCE;
use crate::consistency::measured_and_expected;

/// Fewest samples a second of EMG in which the onset of a response can be seen, Hz: surface EMG reaches up to some 450 Hz, which needs more
/// than twice as many samples, and an onset is known to 5 ms, which then have five of them.
pub const LOWEST_ONSET_HZ: f64 = 1000.0;

/// Whether the onset of a response can be seen in EMG of so many samples a second, by a clock that may be as far off as clocks are.
pub fn shows_onsets(rate_hz: f64) -> bool {
    rate_hz >= LOWEST_ONSET_HZ * (1.0 - CLOCK_TOLERANCE)
}

/// What to know of EMG before it is trusted.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EmgWarning {
    /// It has too few samples a second for the onset of a response.
    Slow {
        /// Samples a second.
        rate_hz: f64,
    },
    /// A column is clipped at one end of its range.
    Clipped(ClippedEmg),
    /// It is no fraction of a maximal effort.
    NoFractionOfMvc {
        /// What was measured.
        measured: String,
        /// What was expected.
        expected: String,
    },
}

impl fmt::Display for EmgWarning {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Slow { rate_hz } => write!(
                formatter,
                "EMG of {rate_hz:.1} samples a second cannot show when a response begins, which takes {LOWEST_ONSET_HZ} or more: the report \
                 gives no latency"
            ),
            Self::Clipped(own) => {
                let place = format!("EMG in column {:?}", own.column);
                let measured = format!("{} samples are at its extreme, {}", own.samples, own.value);
                let expected = "no extreme that is reached more often than the values before it";
                let told = measured_and_expected(&place, &own.trials, &measured, expected);
                write!(formatter, "{told}; was the gain too high? Its size is too low where it is clipped")
            }
            Self::NoFractionOfMvc { measured, expected } => {
                write!(formatter, "{measured}; expected {expected}")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_device_of_1_khz_shows_onsets_though_its_clock_is_slow_and_one_of_500_hz_does_not() {
        assert!(shows_onsets(999.9) && shows_onsets(2000.0));
        assert!(!shows_onsets(500.0) && !shows_onsets(990.0));
    }
}
