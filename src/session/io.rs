//! One step of the session: what goes in, what comes out, and what transition, in a form that the journal keeps.

use serde::{Deserialize, Serialize};

use super::event::Event;
use super::phase::Phase;
use super::settings::PlannedTrial;
use crate::rig::{Command, Fault, Sample};

/// What the session is told at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// What the rig gave.
    pub reading: Reading,
    /// A word of the operator since the last sample; one at a time.
    pub operator: Option<Event>,
    /// Everything that transition so far is safely on disk. The ramp waits for it.
    pub on_disk: bool,
}

/// What the rig gave at a sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Reading {
    /// A sample of all channels.
    Sample(Sample),
    /// It failed.
    Fault(Fault),
    /// It is disarmed and measures nothing.
    Disarmed,
}

/// What the session wants done, and what it has found out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Output {
    /// What the motor does and the person is shown until the next sample.
    pub command: Command,
    /// The phase after this step.
    pub phase: Phase,
    /// What transition at this sample, if anything did.
    pub transition: Option<TransitionRecord>,
    /// A word of the operator that is not possible in this phase.
    pub refused: Option<Event>,
    /// Where the sample belongs.
    pub record: RecordTarget,
    /// For the displays: how much of the gate's time has been held (0 to 1).
    pub gate_fraction: f64,
}

/// To which record a sample belongs.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RecordTarget {
    /// To none.
    None,
    /// To the measurement of the offset.
    Offset,
    /// To a maximal effort, counted from 1.
    Effort(u32),
    /// To the trial under way.
    Trial,
}

/// One line of the session's story. The lines so far are all that is needed to go on after a crash.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct TransitionRecord {
    /// Samples since the session was started or resumed.
    pub sample: u64,
    /// The phase before.
    pub from: Phase,
    /// What transition.
    pub event: Event,
    /// The phase after.
    pub to: Phase,
    /// What else there is to know.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub detail: Option<TransitionDetail>,
}

/// What a [`TransitionRecord`] has to say beside its names.
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
        /// The same of the extensor.
        peak_ecr: f64,
    },
    /// A trial began.
    Began {
        /// Its number in its table, from 1.
        number: u32,
        /// For practice, in a table of its own.
        practice: bool,
        /// Its place in the schedule.
        position: u32,
        /// Rest since the motor was last home, samples.
        rest_samples: u64,
    },
    /// A trial went on to its ramp.
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
        /// What became of it.
        status: Status,
        /// Samples since it began.
        samples: u64,
    },
    /// A fault.
    Fault(Fault),
    /// A fault in a trial, which ended with it.
    FaultInTrial {
        /// What went wrong.
        fault: Fault,
        /// Number of the trial.
        number: u32,
        /// Samples since it began.
        samples: u64,
    },
    /// The rig was armed again after a fault.
    Rearmed {
        /// Where the motor was then, rad.
        angle_rad: f64,
    },
    /// The last trial was taken back.
    TakenBack {
        /// Its number.
        number: u32,
    },
}

/// What became of a trial. Only `Ok` trials are analysed; nothing is deleted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// Complete and usable.
    Ok,
    /// Interrupted by a fault, the operator or the end of the program.
    Aborted,
    /// The person did not hold the torque as asked.
    Rejected,
}

impl Status {
    /// The word in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::Aborted => "aborted",
            Self::Rejected => "rejected",
        }
    }
}

/// A trial that has begun, and what became of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Attempt {
    /// Number in its table (practice trials have their own), from 1.
    pub number: u32,
    /// Which trial of the schedule.
    pub planned: PlannedTrial,
    /// Rest since the motor was last home, samples.
    pub rest_samples: u64,
    /// Where in its record the ramp began, if it did.
    pub onset_sample: Option<u64>,
    /// What became of it, and why; `None` while it is under way.
    pub ended: Option<(Status, Event)>,
    /// Samples since it began.
    pub samples: u64,
}
