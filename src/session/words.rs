//! The words of the state machine: its phases, and what makes it go from one to the next.

use serde::{Deserialize, Serialize};

/// Where the session is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Phase {
    /// The rig is disarmed; waits for the operator's word.
    Ready,
    /// The hand is relaxed; the offset of the torque is measured.
    Offset,
    /// The person pushes, or pulls, as hard as possible.
    MvcEffort,
    /// Rest after a maximal effort.
    MvcRest,
    /// Rest before the next trial.
    Rest,
    /// The target is shown; the gate is shut until the torque has stayed near it for long enough.
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
    /// Something is wrong; the motor is safe and the rig disarmed until the operator's word.
    Faulted,
    /// Every trial of the protocol is done.
    Finished,
    /// The operator ended the session before its time; it can be resumed.
    Aborted,
}

/// What makes the session go from one phase to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// Operator: arm the rig and begin.
    Start,
    /// Operator: stop after what cannot be interrupted.
    Pause,
    /// Operator: go on.
    Resume,
    /// Operator: leave out this trial, or the next one.
    Skip,
    /// Operator: the last trial does not count; run it again.
    Repeat,
    /// Operator: end the session now.
    Abort,
    /// Operator: the cause of the fault is mended; arm the rig again.
    Rearm,
    /// The offset was measured for its time.
    OffsetMeasured,
    /// A maximal effort took its time.
    EffortOver,
    /// A rest took its time.
    RestOver,
    /// The torque stayed in the band for the gate's time.
    GateOpened,
    /// The torque did not stay in the band within the time allowed.
    GateTimedOut,
    /// The torque left the band between the gate and the onset.
    LeftBand,
    /// The EMG of the antagonist went over its limit.
    AntagonistActive,
    /// The delay after the gate is over: the ramp begins.
    Onset,
    /// The ramp reached its end.
    RampOver,
    /// The hold after the ramp took its time.
    HoldOver,
    /// The motor is back at the start position.
    Home,
    /// The rig failed, or a limit was broken.
    Fault,
}

/// Who brings an event about.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// The operator's word.
    Operator,
    /// The time in samples, or the planned movement.
    Time,
    /// What the person does.
    Person,
    /// The rig.
    Rig,
}

impl Phase {
    /// All phases, in the order a session meets them.
    pub const ALL: [Self; 15] = [
        Self::Ready,
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

    /// The word in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ready => "ready",
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

    /// Whether a trial is under way.
    pub fn in_trial(self) -> bool {
        matches!(self, Self::Hold | Self::Delay | Self::Ramp | Self::RampHold)
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

impl Event {
    /// All events.
    pub const ALL: [Self; 19] = [
        Self::Start,
        Self::Pause,
        Self::Resume,
        Self::Skip,
        Self::Repeat,
        Self::Abort,
        Self::Rearm,
        Self::OffsetMeasured,
        Self::EffortOver,
        Self::RestOver,
        Self::GateOpened,
        Self::GateTimedOut,
        Self::LeftBand,
        Self::AntagonistActive,
        Self::Onset,
        Self::RampOver,
        Self::HoldOver,
        Self::Home,
        Self::Fault,
    ];

    /// The word in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Skip => "skip",
            Self::Repeat => "repeat",
            Self::Abort => "abort",
            Self::Rearm => "rearm",
            Self::OffsetMeasured => "offset_measured",
            Self::EffortOver => "effort_over",
            Self::RestOver => "rest_over",
            Self::GateOpened => "gate_opened",
            Self::GateTimedOut => "gate_timed_out",
            Self::LeftBand => "left_band",
            Self::AntagonistActive => "antagonist_active",
            Self::Onset => "onset",
            Self::RampOver => "ramp_over",
            Self::HoldOver => "hold_over",
            Self::Home => "home",
            Self::Fault => "fault",
        }
    }

    /// Who brings it about.
    pub fn source(self) -> Source {
        match self {
            Self::Start
            | Self::Pause
            | Self::Resume
            | Self::Skip
            | Self::Repeat
            | Self::Abort
            | Self::Rearm => Source::Operator,
            Self::GateOpened | Self::GateTimedOut | Self::LeftBand | Self::AntagonistActive => Source::Person,
            Self::Fault => Source::Rig,
            _ => Source::Time,
        }
    }
}

impl Source {
    /// The word in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Time => "time",
            Self::Person => "person",
            Self::Rig => "rig",
        }
    }
}
