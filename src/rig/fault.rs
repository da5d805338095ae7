//! What can go wrong while a rig is armed. Every fault has a name, and none is a log line.

use serde::{Deserialize, Serialize};

/// Why the motor was made safe.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, thiserror::Error)]
#[serde(tag = "fault", rename_all = "snake_case")]
pub enum Fault {
    /// A channel gave something that is no number.
    #[error("the {channel} channel gave no number; check its cable and amplifier")]
    NotANumber {
        /// Which channel.
        channel: Channel,
    },
    /// A measured quantity is beyond the protocol's limit.
    #[error(
        "the measured {quantity} of {measured} is beyond the limit of {limit}; see limits in the protocol"
    )]
    Limit {
        /// Which quantity.
        quantity: Quantity,
        /// What was measured.
        measured: f64,
        /// What was allowed.
        limit: f64,
    },
    /// The period ended without a sample.
    #[error("no sample arrived in time; check the connection to the rig")]
    NoSample,
    /// A maximal effort left a muscle's EMG silent, so that nothing can be given as a fraction of it.
    #[error("the {channel} channel stayed silent in the maximal effort; check its electrodes")]
    SilentEffort {
        /// Which channel.
        channel: Channel,
    },
    /// The motor on the CAN bus, or the bus itself.
    #[error(transparent)]
    Can(#[from] super::can::CanFault),
}

/// A measured signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Channel {
    /// Motor angle.
    Angle,
    /// Lever torque.
    Torque,
    /// EMG of the flexor carpi radialis.
    EmgFcr,
    /// EMG of the extensor carpi radialis.
    EmgEcr,
}

/// A measured quantity that has a limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// Motor angle, rad.
    Angle,
    /// Motor speed, rad/s.
    Speed,
    /// Lever torque, N m.
    Torque,
}

impl std::fmt::Display for Channel {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Angle => "angle",
            Self::Torque => "torque",
            Self::EmgFcr => "FCR EMG",
            Self::EmgEcr => "ECR EMG",
        })
    }
}

impl std::fmt::Display for Quantity {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.write_str(match self {
            Self::Angle => "angle (rad)",
            Self::Speed => "speed (rad/s)",
            Self::Torque => "torque (N m)",
        })
    }
}
