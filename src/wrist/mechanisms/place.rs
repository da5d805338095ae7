//! Where a mechanism acts, and how far its real law may differ from the catalogued one.

use serde::{Deserialize, Serialize};

/// The part of the model at which a mechanism acts.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Place {
    /// The torque in the joint, T_j.
    Joint,
    /// The torque between handle and hand, T_h.
    Interface,
    /// The torque in the lever, T_l.
    Handle,
    /// The torque channel.
    TorqueChannel,
    /// The angle channel.
    AngleChannel,
    /// The differences between trials.
    Trials,
}

impl Place {
    /// Identifier in results.
    pub fn id(self) -> &'static str {
        match self {
            Self::Joint => "joint",
            Self::Interface => "interface",
            Self::Handle => "handle",
            Self::TorqueChannel => "torque_channel",
            Self::AngleChannel => "angle_channel",
            Self::Trials => "trials",
        }
    }
}

/// The quantity that a mechanism's law is a function of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Argument {
    /// Angle at the place, rad.
    Angle,
    /// Angular velocity at the place, rad/s.
    Speed,
    /// Joint angle less the elastic limit, rad.
    AngleBeyondYield,
    /// Time since the onset, s.
    Time,
    /// Angular velocity at all past times, rad/s.
    PastSpeed,
    /// Handle angle less joint angle, rad.
    Deflection,
    /// Torque at the place, N m.
    Torque,
    /// Torque at all past times, N m.
    PastTorque,
}

impl Argument {
    /// Identifier in results.
    pub fn id(self) -> &'static str {
        match self {
            Self::Angle => "angle",
            Self::Speed => "speed",
            Self::AngleBeyondYield => "angle_beyond_yield",
            Self::Time => "time",
            Self::PastSpeed => "past_speed",
            Self::Deflection => "deflection",
            Self::Torque => "torque",
            Self::PastTorque => "past_torque",
        }
    }
}

/// The functions that a mechanism's real law is one of: the catalogued law times one plus a smooth function of its argument.
///
/// The spread is declared for each mechanism once, before a benchmark is run, and is not tuned to one.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LawSpace {
    /// Where the mechanism acts.
    pub place: Place,
    /// Argument of its law; `None` if the mechanism is a constant, a gain or a pure delay, whose form is certain.
    pub argument: Option<Argument>,
    /// Standard deviation of the real law about the catalogued one, relative to the latter.
    pub sd: f64,
}
