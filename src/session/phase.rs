//! The phases of a session.

use serde::{Deserialize, Serialize};

/// Phase of the session.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// The rig is disarmed; the session waits for the operator's start.
    Ready,
    /// The motor is at rest at the start position. The operator mounts the load of the next rig trial; after the last one, the
    /// subject is seated. With its load mounted, the next rig trial begins after a short rest.
    RigSetup,
    /// A rig trial has begun; the motor is still at rest.
    RigSettle,
    /// The motor makes the motion of a rig trial.
    RigMotion,
    /// The hand is relaxed; the offset of the torque is measured.
    Offset,
    /// The subject pushes or pulls as hard as possible.
    MvcEffort,
    /// Rest after a maximal effort.
    MvcRest,
    /// Rest before the next trial.
    Rest,
    /// The target is shown; the gate opens when the torque has stayed in the band around it for the gate's time.
    Hold,
    /// The gate is open; the onset is still to come.
    Delay,
    /// The motor extends the wrist.
    Ramp,
    /// The motor stays at the end of the ramp.
    RampHold,
    /// The motor turns back.
    Return,
    /// After a fault, the motor goes from where it was to the start position.
    Homing,
    /// Waits for the operator to go on.
    Paused,
    /// A fault occurred; the motor is safe and the rig disarmed until the operator rearms it.
    Faulted,
    /// Every trial of the protocol is done.
    Finished,
    /// The operator ended the session before its last trial; it can be resumed.
    Aborted,
}

impl Phase {
    /// All phases, in the order a session meets them.
    pub const ALL: [Self; 18] = [
        Self::Ready,
        Self::RigSetup,
        Self::RigSettle,
        Self::RigMotion,
        Self::Offset,
        Self::MvcEffort,
        Self::MvcRest,
        Self::Rest,
        Self::Hold,
        Self::Delay,
        Self::Ramp,
        Self::RampHold,
        Self::Return,
        Self::Homing,
        Self::Paused,
        Self::Faulted,
        Self::Finished,
        Self::Aborted,
    ];

    /// Name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ready => "ready",
            Self::RigSetup => "rig_setup",
            Self::RigSettle => "rig_settle",
            Self::RigMotion => "rig_motion",
            Self::Offset => "offset",
            Self::MvcEffort => "mvc_effort",
            Self::MvcRest => "mvc_rest",
            Self::Rest => "rest",
            Self::Hold => "hold",
            Self::Delay => "delay",
            Self::Ramp => "ramp",
            Self::RampHold => "ramp_hold",
            Self::Return => "return",
            Self::Homing => "homing",
            Self::Paused => "paused",
            Self::Faulted => "faulted",
            Self::Finished => "finished",
            Self::Aborted => "aborted",
        }
    }

    /// Whether a trial or a rig trial is under way.
    pub fn in_trial(self) -> bool {
        matches!(self, Self::Hold | Self::Delay | Self::Ramp | Self::RampHold) || self.in_rig_trial()
    }

    /// Whether a rig trial is under way.
    pub fn in_rig_trial(self) -> bool {
        matches!(self, Self::RigSettle | Self::RigMotion)
    }

    /// Whether the rig must be armed here.
    pub fn is_armed(self) -> bool {
        !matches!(self, Self::Ready | Self::Faulted | Self::Finished | Self::Aborted)
    }

    /// Whether the session is over.
    pub fn is_final(self) -> bool {
        matches!(self, Self::Finished | Self::Aborted)
    }
}
