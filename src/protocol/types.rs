//! The fields of a protocol file, with the range that each may have.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::RigTrialBlock;
use crate::signal::FilterSpec;

/// Format and version of the protocol files that this program reads.
pub const PROTOCOL_FORMAT: &str = "ramphold-protocol/1";

/// A ramp-and-hold experiment, as written in a protocol file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Format and version: `ramphold-protocol/1`.
    #[schemars(extend("const" = PROTOCOL_FORMAT))]
    pub format: String,
    /// Name of the protocol, as shown in reports.
    #[schemars(length(min = 1))]
    pub name: String,
    /// Ramp velocities, rad/s; positive extends the wrist.
    #[schemars(length(min = 1), inner(range(min = -20, max = 20)))]
    pub velocities_rad_s: Vec<f64>,
    /// Target torques, N m; positive resists extension.
    #[schemars(length(min = 1), inner(range(min = -20, max = 20)))]
    pub torques_nm: Vec<f64>,
    /// Number of repetitions of each combination of velocity and torque.
    #[schemars(range(min = 1, max = 1000))]
    pub repetitions: u32,
    /// How the order of the trials is drawn.
    pub order: Order,
    /// When a ramp may start.
    pub gate: Gate,
    /// Rest after each trial, s.
    #[schemars(range(min = 0, max = 600))]
    pub rest_s: f64,
    /// The movement.
    pub ramp: Ramp,
    /// Optional phases before the trials.
    #[serde(default)]
    pub before: Before,
    /// Sampling and filtering.
    pub signal: Signal,
    /// The analysed window after the onset, s.
    #[schemars(range(min = 0.005, max = 0.5))]
    pub window_s: f64,
    /// Limits that no trajectory may exceed.
    pub limits: Limits,
    /// Motions with known loads on the handle, before the subject sits down, in this order.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub rig_trials: Vec<RigTrialBlock>,
}

/// How the order of the trials is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Order {
    /// All trials in one random order, as in the paper.
    Shuffled,
    /// Each repetition is a block with its own random order.
    Blocked,
    /// Random, with at most `max_run` trials in a row of the same torque, and of the same velocity.
    Constrained {
        /// Longest run allowed.
        #[schemars(range(min = 1))]
        max_run: u32,
    },
    /// Latin square balanced for first-order carry-over; the row is the subject's number.
    Williams,
    /// Exactly this list, in this order.
    Fixed {
        /// One entry for each trial.
        #[schemars(length(min = 1))]
        trials: Vec<Condition>,
    },
}

/// One combination of velocity and torque.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Ramp velocity, rad/s: one of `velocities_rad_s`.
    #[schemars(range(min = -20, max = 20))]
    pub velocity_rad_s: f64,
    /// Target torque, N m: one of `torques_nm`.
    #[schemars(range(min = -20, max = 20))]
    pub torque_nm: f64,
}

/// When a ramp may start: the torque has stayed near the target for long enough.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// Half-width of the band as a fraction of the target torque.
    #[schemars(range(min = 0.001, max = 0.5))]
    pub band_fraction: f64,
    /// Time for which the torque must stay in the band without interruption, s.
    #[schemars(range(min = 0.01, max = 60))]
    pub duration_s: f64,
    /// Time after the target is shown at which a trial whose gate has not opened is rejected, s.
    #[schemars(range(min = 0.1, max = 600))]
    pub timeout_s: f64,
    /// Random delay between the gate and the onset, s: uniform between the two numbers.
    #[serde(default)]
    #[schemars(inner(range(min = 0, max = 60)))]
    pub delay_s: [f64; 2],
    /// Reject the trial if the antagonist's (ECR) EMG exceeds this fraction of MVC during the gate.
    #[serde(default)]
    #[schemars(range(min = 0.001, max = 1))]
    pub antagonist_limit_mvc: Option<f64>,
}

/// The movement of one trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// Amplitude: the angle by which the motor turns, rad.
    #[schemars(range(min = 0.001, max = 1.5))]
    pub amplitude_rad: f64,
    /// Time in which the speed rises to the ramp velocity, and falls at the end, s (raised cosine).
    #[schemars(range(min = 0.001, max = 1))]
    pub rise_time_s: f64,
    /// Time for which the end angle is held, s.
    #[schemars(range(min = 0, max = 60))]
    pub hold_s: f64,
    /// Speed of the return to the start position, rad/s.
    #[schemars(range(min = 0.01, max = 20))]
    pub return_velocity_rad_s: f64,
    /// Largest difference between the measured and the asked velocity of a ramp, as a fraction of the asked one. A trial
    /// whose ramp differs by more is rejected and run again.
    #[serde(default = "default_velocity_tolerance")]
    #[schemars(range(min = 0.001, max = 0.5))]
    pub velocity_tolerance: f64,
}

/// Half of the way from the paper's fastest velocity to the next, 3.25 to 2.6 rad/s: beyond it, a ramp would be nearer to
/// another condition than to its own.
fn default_velocity_tolerance() -> f64 {
    0.1
}

/// Optional phases before the trials.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Before {
    /// Measure the torque offset with a relaxed hand for this long, s.
    #[serde(default)]
    #[schemars(range(min = 0.1, max = 600))]
    pub offset_s: Option<f64>,
    /// Measure the maximal voluntary contraction.
    #[serde(default)]
    pub mvc: Option<Mvc>,
    /// Number of familiarisation trials: recorded, not analysed.
    #[serde(default)]
    #[schemars(range(max = 1000))]
    pub familiarisation_trials: u32,
}

/// Measurement of the maximal voluntary contraction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mvc {
    /// Number of efforts in each direction.
    #[schemars(range(min = 1, max = 20))]
    pub efforts: u32,
    /// Duration of each effort, s.
    #[schemars(range(min = 0.5, max = 60))]
    pub duration_s: f64,
    /// Rest after each effort, s.
    #[schemars(range(min = 0, max = 600))]
    pub rest_s: f64,
}

/// Sampling and filtering of the signals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Sample rate, samples per second.
    #[schemars(range(min = 100, max = 100_000))]
    pub sample_rate_hz: f64,
    /// The low-pass filter of the analysis.
    pub filter: FilterSpec,
}

/// Limits of every trajectory and measurement; a value outside them is a fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Lowest and highest motor angle, rad from the start position.
    #[schemars(inner(range(min = -1.6, max = 1.6)))]
    pub angle_rad: [f64; 2],
    /// Highest speed of the motor, rad/s.
    #[schemars(range(min = 0.01, max = 100))]
    pub speed_rad_s: f64,
    /// Highest acceleration of the motor, rad/s2.
    #[schemars(range(min = 0.1, max = 100_000))]
    pub acceleration_rad_s2: f64,
    /// Highest measured torque, N m, either sign.
    #[schemars(range(min = 0.1, max = 100))]
    pub torque_nm: f64,
}
