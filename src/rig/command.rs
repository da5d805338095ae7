//! What a rig is told each period: what the motor does, and what the subject is shown.

use crate::protocol::RigLoad;

/// What a rig is told each period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Command {
    /// What the motor does.
    pub motor: Motor,
    /// What the person is shown.
    pub cue: Cue,
}

/// What the motor does until the next sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motor {
    /// Be at this angle at the next sample.
    Follow {
        /// Angle from the start position, rad.
        angle_rad: f64,
    },
    /// Go to the safe state of the rig and stay there.
    Safe,
}

/// What the person is shown. Only people look at it: the drive of a motor does not.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cue {
    /// Rest; nothing is asked.
    Rest,
    /// Let go entirely: the offset is being measured.
    Relax,
    /// As hard as possible, in this direction.
    Effort(Direction),
    /// Bring the shown torque to the target and keep it there.
    Target {
        /// The target torque, N m.
        target_nm: f64,
        /// The torque on the display, offset removed and smoothed, N m.
        shown_nm: f64,
        /// The trial that this is for.
        trial: Upcoming,
    },
    /// Keep on as before: the motor is moving.
    Moving,
    /// Nobody is there: a rig trial is prepared or under way.
    RigTrial(UpcomingRigTrial),
}

/// Which way the person pushes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Flexion: against the ramp.
    Flexion,
    /// Extension: with it.
    Extension,
}

/// Names a trial by its place in the schedule, so that a trial that is run again after an interruption draws the same
/// random numbers, and one that was rejected draws new ones.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TrialKey {
    /// Run for practice, before the measured trials.
    pub practice: bool,
    /// Place in the order drawn, from 1.
    pub position: u32,
    /// How often it was rejected before.
    pub rejections: u32,
}

/// A trial before its ramp. A person is told nothing of it; a virtual person's muscle needs it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Upcoming {
    /// Which trial.
    pub key: TrialKey,
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Its place in the schedule, from 0 (first) to 1 (last).
    pub progress: f64,
    /// Rest since the motor was last home, s.
    pub rest_s: f64,
}

/// A rig trial that is prepared or under way. Only a virtual rig looks at it: what is mounted on a real handle, the operator has mounted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UpcomingRigTrial {
    /// Its place among the rig trials of the protocol, from 1.
    pub position: u32,
    /// How often it was rejected before.
    pub rejections: u32,
    /// What is mounted on the handle.
    pub load: RigLoad,
    /// How far it is.
    pub stage: RigTrialStage,
}

/// How far a rig trial is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigTrialStage {
    /// Its load is being mounted; it has not begun.
    Mounting,
    /// It has begun; the motor is at rest.
    Settling,
    /// The motor makes its motion.
    Moving,
}
