//! Input and output of the state machine, and the record of a transition as the journal keeps it.

use serde::{Deserialize, Serialize};

use super::event::Event;
use super::motion::MotionDeviation;
use super::phase::Phase;
use super::settings::PlannedTrial;
use crate::protocol::PlannedRigTrial;
use crate::rig::{Command, Direction, Fault, Punctuality, Sample};

/// Input of the state machine at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Reading of the rig.
    pub reading: Reading,
    /// Command of the operator since the last sample, if there was one.
    pub operator: Option<Event>,
    /// Whether all transitions so far are on disk. The ramp waits for it.
    pub on_disk: bool,
    /// How punctual the periods of the rig were since the last sample, if the rig is tied to a clock.
    pub punctuality: Option<Punctuality>,
}

/// Reading of the rig at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// A sample of all channels.
    Sample(Sample),
    /// The rig failed.
    Fault(Fault),
    /// The rig is disarmed and measures nothing.
    Disarmed,
}

/// Output of the state machine at one sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// Command for the motor and cue for the subject until the next sample.
    pub command: Command,
    /// Angle that was commanded for this sample, rad.
    pub target_rad: f64,
    /// The phase after this step.
    pub phase: Phase,
    /// Transition at this sample, if there was one.
    pub transition: Option<TransitionRecord>,
    /// Command of the operator that is not possible in this phase.
    pub refused: Option<Event>,
    /// Record that the sample belongs to.
    pub record: RecordTarget,
    /// Fraction of the gate's time that the torque has been in the band, 0 to 1.
    pub gate_fraction: f64,
}

/// Record that a sample belongs to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordTarget {
    /// No record.
    None,
    /// The measurement of the torque offset.
    Offset,
    /// A maximal effort, numbered from 1.
    Effort(u32),
    /// The trial under way.
    Trial,
    /// The rig trial under way.
    RigTrial,
}

/// A transition of the state machine. The records so far suffice to resume the session after a crash.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TransitionRecord {
    /// Samples since the session was started or resumed.
    pub sample: u64,
    /// The phase before.
    pub from: Phase,
    /// The event.
    pub event: Event,
    /// The phase after.
    pub to: Phase,
    /// Numbers that belong to the transition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<TransitionDetail>,
}

/// Numbers that belong to a transition.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TransitionDetail {
    /// The torque with the hand relaxed, N m.
    OffsetNm(f64),
    /// The result of a maximal effort.
    Effort {
        /// Highest smoothed torque, N m, either sign.
        peak_torque_nm: f64,
        /// Highest smoothed EMG of the flexor, in the units in force.
        peak_fcr: f64,
        /// Highest smoothed EMG of the extensor, in the units in force.
        peak_ecr: f64,
    },
    /// A trial or a rig trial began.
    Began {
        /// Its number in its table, from 1.
        number: u32,
        /// For practice, in a table of its own.
        practice: bool,
        /// Its place in the schedule, or among the rig trials of the protocol.
        position: u32,
        /// Rest since the motor was last home, samples.
        rest_samples: u64,
    },
    /// A trial went on to its ramp, or a rig trial to its motion.
    Onset {
        /// Samples since the trial began.
        trial_sample: u64,
        /// Samples by which the ramp waited for the disk.
        waited_samples: u64,
    },
    /// A trial ended.
    Ended {
        /// Its number.
        number: u32,
        /// Status of the trial.
        status: Status,
        /// Samples since it began.
        samples: u64,
        /// Why its motion was not as asked, if it was rejected for that.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        deviation: Option<MotionDeviation>,
        /// How punctual its periods were; lost periods are those since the onset if there was one. `None` for a rig that is
        /// not tied to a clock, and in journals of earlier versions.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        punctuality: Option<Punctuality>,
    },
    /// A fault.
    Fault(Fault),
    /// A fault in a trial, which ended with it.
    FaultInTrial {
        /// The fault.
        fault: Fault,
        /// Number of the trial.
        number: u32,
        /// Samples since it began.
        samples: u64,
        /// How punctual its periods were, as in `Ended`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        punctuality: Option<Punctuality>,
    },
    /// The rig was armed again after a fault.
    Rearmed {
        /// Motor angle at that time, rad.
        angle_rad: f64,
    },
    /// The last trial was rejected by the operator, to be repeated.
    TakenBack {
        /// Its number.
        number: u32,
    },
}

/// A maximal effort that is done.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MaximalEffort {
    /// Direction in which the subject pushed.
    pub direction: Direction,
    /// Highest smoothed torque, offset included, N m, either sign.
    pub peak_torque_nm: f64,
    /// Highest smoothed EMG of the flexor, in the units in force.
    pub peak_fcr: f64,
    /// Highest smoothed EMG of the extensor, in the units in force.
    pub peak_ecr: f64,
}

/// Status of a trial. Only `Ok` trials are analysed; nothing is deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Complete and usable.
    Ok,
    /// Interrupted by a fault, the operator or the end of the program.
    Aborted,
    /// The subject did not hold the torque as required, or the motion was not as asked.
    Rejected,
}

impl Status {
    /// Name in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Aborted => "aborted",
            Self::Rejected => "rejected",
        }
    }
}

/// A trial that has begun, and its status.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attempt {
    /// Number in its table (practice trials have their own), from 1.
    pub number: u32,
    /// Trial of the schedule.
    pub planned: PlannedTrial,
    /// Rest since the motor was last home, samples.
    pub rest_samples: u64,
    /// Sample of the record at which the ramp began, if it began.
    pub onset_sample: Option<u64>,
    /// Status and the event that ended the trial; `None` while it is under way.
    pub ended: Option<(Status, Event)>,
    /// Samples since it began.
    pub samples: u64,
    /// How punctual its periods were, if the rig is tied to a clock.
    pub punctuality: Option<Punctuality>,
}

/// A rig trial that has begun, and its status.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RigAttempt {
    /// Number in the table of rig trials, from 1.
    pub number: u32,
    /// Rig trial of the protocol.
    pub planned: PlannedRigTrial,
    /// Status and the event that ended the rig trial; `None` while it is under way.
    pub ended: Option<(Status, Event)>,
    /// Samples since it began.
    pub samples: u64,
}
