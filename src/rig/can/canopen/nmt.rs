//! Network management: the commands, and the states that heartbeats tell.

use std::fmt;

use serde::Serialize;

/// What a node is told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NmtCommand {
    /// Go to OPERATIONAL: PDOs run.
    Start,
    /// Go to STOPPED: nothing but NMT and heartbeats.
    Stop,
    /// Go to PRE-OPERATIONAL: SDOs, no PDOs.
    EnterPreOperational,
}

impl NmtCommand {
    /// The command specifier.
    pub fn specifier(self) -> u8 {
        match self {
            Self::Start => 1,
            Self::Stop => 2,
            Self::EnterPreOperational => 128,
        }
    }
}

/// What a heartbeat says.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum NmtState {
    /// The node has just started.
    BootUp,
    /// STOPPED.
    Stopped,
    /// OPERATIONAL.
    Operational,
    /// PRE-OPERATIONAL.
    PreOperational,
    /// A number that the standard does not know.
    Unknown,
}

impl NmtState {
    /// From the payload of a heartbeat.
    pub fn from_byte(byte: u8) -> Self {
        match byte & 0x7F {
            0 => Self::BootUp,
            4 => Self::Stopped,
            5 => Self::Operational,
            127 => Self::PreOperational,
            _ => Self::Unknown,
        }
    }
}

impl fmt::Display for NmtState {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Self::BootUp => "BOOT-UP",
            Self::Stopped => "STOPPED",
            Self::Operational => "OPERATIONAL",
            Self::PreOperational => "PRE-OPERATIONAL",
            Self::Unknown => "an unknown state",
        })
    }
}
