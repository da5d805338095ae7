//! What the experimenter writes: velocities, torques, the gate, the ramp, the limits.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::signal::FilterSpec;

/// A ramp-and-hold experiment, as written in a protocol file.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Format and version: `ramphold-protocol/1`.
    pub format: String,
    /// A name for people.
    pub name: String,
    /// Ramp velocities, rad/s; positive extends the wrist.
    pub velocities_rad_s: Vec<f64>,
    /// Target torques, N m.
    pub torques_nm: Vec<f64>,
    /// How often each combination of velocity and torque is run.
    pub repetitions: u32,
    /// How the order of the trials is drawn.
    pub order: Order,
    /// When a ramp may start.
    pub gate: Gate,
    /// Rest after each trial, s.
    pub rest_s: f64,
    /// The movement.
    pub ramp: Ramp,
    /// What comes before the trials.
    #[serde(default)]
    pub before: Before,
    /// Sampling and filtering.
    pub signal: Signal,
    /// The analysed window after the onset, s.
    pub window_s: f64,
    /// What no trajectory may exceed.
    pub limits: Limits,
}

/// How the order of the trials is drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Order {
    /// All trials in one random order (the paper's).
    Shuffled,
    /// Each repetition is a block in random order of its own.
    Blocked,
    /// Random, with at most `max_run` trials in a row of the same torque, and of the same velocity.
    Constrained {
        /// Longest run allowed.
        max_run: u32,
    },
    /// Latin square balanced for first-order carry-over; the row is the subject's number.
    Williams,
    /// Exactly this list, in this order.
    Fixed {
        /// One entry a trial.
        trials: Vec<Condition>,
    },
}

/// One combination of velocity and torque.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Ramp velocity, rad/s.
    pub velocity_rad_s: f64,
    /// Target torque, N m.
    pub torque_nm: f64,
}

/// When a ramp may start: the torque has stayed near the target for long enough.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gate {
    /// Half-width of the band as a fraction of the target torque.
    pub band_fraction: f64,
    /// How long the torque must stay inside without a break, s.
    pub duration_s: f64,
    /// When to give up a trial, s after the target was shown.
    pub timeout_s: f64,
    /// Random delay between the gate and the onset, s: uniform between the two numbers.
    #[serde(default)]
    pub delay_s: [f64; 2],
    /// Reject the trial if the antagonist's (ECR) EMG exceeds this fraction of MVC during the gate.
    #[serde(default)]
    pub antagonist_limit_mvc: Option<f64>,
}

/// The movement of one trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Ramp {
    /// How far the motor turns, rad.
    pub amplitude_rad: f64,
    /// Time in which the speed rises to the ramp velocity, and falls at the end, s (raised cosine).
    pub rise_time_s: f64,
    /// How long the end angle is held, s.
    pub hold_s: f64,
    /// Speed of the way back, rad/s.
    pub return_velocity_rad_s: f64,
}

/// Optional phases before the trials.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Before {
    /// Measure the torque offset with a relaxed hand for this long, s.
    #[serde(default)]
    pub offset_s: Option<f64>,
    /// Measure the maximal voluntary contraction.
    #[serde(default)]
    pub mvc: Option<Mvc>,
    /// Number of familiarisation trials: recorded, not analysed.
    #[serde(default)]
    pub familiarisation_trials: u32,
}

/// Measurement of the maximal voluntary contraction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Mvc {
    /// How often the person pushes, and how often they pull.
    pub efforts: u32,
    /// Duration of each effort, s.
    pub duration_s: f64,
    /// Rest after each effort, s.
    pub rest_s: f64,
}

/// Sampling and filtering of the signals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signal {
    /// Samples a second.
    pub sample_rate_hz: f64,
    /// The low-pass filter of the analysis.
    pub filter: FilterSpec,
}

/// What no trajectory and no measurement may exceed; beyond it is a fault.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Limits {
    /// Lowest and highest motor angle, rad from the start position.
    pub angle_rad: [f64; 2],
    /// Highest speed of the motor, rad/s.
    pub speed_rad_s: f64,
    /// Highest acceleration of the motor, rad/s2.
    pub acceleration_rad_s2: f64,
    /// Highest measured torque, N m, either sign.
    pub torque_nm: f64,
}
