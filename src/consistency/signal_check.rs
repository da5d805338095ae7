//! The checks by name, as `--accept` and the results use them.

use std::fmt;
use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// A check of the signals against the table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SignalCheck {
    /// Speed of the ramp against `velocity_rad_s`.
    RampSpeed,
    /// Direction of the ramp against the sign of `velocity_rad_s`.
    RampDirection,
    /// Place of the motion against `onset_s`.
    Onset,
    /// Torque before the ramp against `torque_nm`.
    SteadyTorque,
    /// Whether the wrist resists the ramp.
    Resistance,
    /// Whether the angle before the ramp is one that a wrist can have.
    AngleRange,
    /// Whether EMG is free of offsets and a fraction of maximal voluntary contraction.
    Emg,
    /// Whether EMG goes on changing, as long as its noise and resolution make it.
    EmgFrozen,
    /// Whether angle and torque are measured anew for each sample.
    HeldSamples,
    /// Whether each sample of a ramp goes with its neighbours.
    Spike,
    /// Whether channels stay within what they can show.
    Clipped,
    /// Whether the lever can pass on a ramp of some ten milliseconds.
    Lever,
    /// Whether each trial has a record of its own.
    RepeatedRecord,
}

impl SignalCheck {
    /// All checks.
    pub const ALL: [Self; 13] = [
        Self::RampSpeed,
        Self::RampDirection,
        Self::Onset,
        Self::SteadyTorque,
        Self::Resistance,
        Self::AngleRange,
        Self::Emg,
        Self::EmgFrozen,
        Self::HeldSamples,
        Self::Spike,
        Self::Clipped,
        Self::Lever,
        Self::RepeatedRecord,
    ];

    /// Name on the command line and in results.
    pub fn name(self) -> &'static str {
        match self {
            Self::RampSpeed => "ramp-speed",
            Self::RampDirection => "ramp-direction",
            Self::Onset => "onset",
            Self::SteadyTorque => "steady-torque",
            Self::Resistance => "resistance",
            Self::AngleRange => "angle-range",
            Self::Emg => "emg",
            Self::EmgFrozen => "emg-frozen",
            Self::HeldSamples => "held-samples",
            Self::Spike => "spike",
            Self::Clipped => "clipped",
            Self::Lever => "lever",
            Self::RepeatedRecord => "repeated-record",
        }
    }
}

impl fmt::Display for SignalCheck {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.name())
    }
}

/// A name that no check has.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{name:?} is no check; expected one of {}", SignalCheck::ALL.map(SignalCheck::name).join(", "))]
pub struct UnknownCheck {
    name: String,
}

impl FromStr for SignalCheck {
    type Err = UnknownCheck;

    fn from_str(name: &str) -> Result<Self, UnknownCheck> {
        let named = Self::ALL.into_iter().find(|check| check.name() == name);
        named.ok_or_else(|| UnknownCheck { name: name.to_owned() })
    }
}
