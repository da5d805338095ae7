//! The events that take a session from one phase to another, and where each event comes from.

use serde::{Deserialize, Serialize};

/// Event that can take the session from one phase to another.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Event {
    /// Operator: arm the rig and begin.
    Start,
    /// Operator: pause, during a ramp after the trial.
    Pause,
    /// Operator: go on.
    Resume,
    /// Operator: leave out this trial, or the next one.
    Skip,
    /// Operator: reject the last trial and run it again.
    Repeat,
    /// Operator: do the last maximal effort once more; the best one counts.
    RepeatEffort,
    /// Operator: end the session now.
    Abort,
    /// Operator: the fault has been fixed; arm the rig again.
    Rearm,
    /// The offset was measured for its time.
    OffsetMeasured,
    /// A maximal effort took its time.
    EffortOver,
    /// A rest took its time; before a rig trial, its load was already mounted.
    RestOver,
    /// The torque stayed in the band for the gate's time.
    GateOpened,
    /// The torque did not stay in the band within the time allowed.
    GateTimedOut,
    /// The torque left the band between the gate and the onset.
    LeftBand,
    /// The EMG of the antagonist went over its limit.
    AntagonistActive,
    /// The delay after the gate, or the rest of a rig trial, is over: the motion begins.
    Onset,
    /// The ramp reached its end.
    RampOver,
    /// The hold after the ramp took its time.
    HoldOver,
    /// The motion of the ramp and its hold, or of a rig trial, was not as asked.
    MotionDeviated,
    /// The motor is back at the start position.
    Home,
    /// The rig failed, or a limit was broken.
    Fault,
}

/// Origin of an event.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source {
    /// A command of the operator.
    Operator,
    /// The time in samples, or the planned movement of the motor.
    Time,
    /// The torque or EMG of the subject.
    Subject,
    /// The rig.
    Rig,
}

impl Event {
    /// The commands of the operator.
    pub const COMMANDS: [Self; 8] = [
        Self::Start,
        Self::Pause,
        Self::Resume,
        Self::Skip,
        Self::Repeat,
        Self::RepeatEffort,
        Self::Abort,
        Self::Rearm,
    ];

    /// All events.
    pub const ALL: [Self; 21] = [
        Self::Start,
        Self::Pause,
        Self::Resume,
        Self::Skip,
        Self::Repeat,
        Self::RepeatEffort,
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
        Self::MotionDeviated,
        Self::Home,
        Self::Fault,
    ];

    /// Name in tables and files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Start => "start",
            Self::Pause => "pause",
            Self::Resume => "resume",
            Self::Skip => "skip",
            Self::Repeat => "repeat",
            Self::RepeatEffort => "repeat_effort",
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
            Self::MotionDeviated => "motion_deviated",
            Self::Home => "home",
            Self::Fault => "fault",
        }
    }

    /// Origin of the event.
    pub fn source(self) -> Source {
        match self {
            command if Self::COMMANDS.contains(&command) => Source::Operator,
            Self::GateOpened | Self::GateTimedOut | Self::LeftBand | Self::AntagonistActive => {
                Source::Subject
            }
            Self::MotionDeviated | Self::Fault => Source::Rig,
            _ => Source::Time,
        }
    }
}

impl Source {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Time => "time",
            Self::Subject => "subject",
            Self::Rig => "rig",
        }
    }
}
