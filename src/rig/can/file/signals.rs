//! The fields of a rig file that say what is in which frame, and what is known of the channels.

use schemars::JsonSchema;
use serde::Deserialize;

use super::motors::Identity;
use crate::rig::ChannelDetails;
use crate::rig::can::canopen::{DataType, Object};

/// A CANopen device that measures.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Sensor {
    /// Its node id.
    pub node: u8,
    /// What 1018h must say.
    pub identity: Identity,
    /// How often it sends its heartbeat (1017h), ms.
    pub heartbeat_ms: u16,
    /// After how long without it the program calls it lost, ms.
    pub heartbeat_wait_ms: u16,
}

/// A frame that comes with each SYNC.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct FrameLayout {
    /// The CANopen node that sends it; `null` for a frame of a sensor without CANopen.
    pub node: Option<u8>,
    /// Which of its TPDOs, from 1; for a frame without CANopen `null`.
    pub tpdo: Option<u8>,
    /// The identifier; for a TPDO `null` takes that of the pre-defined connection set.
    pub id: Option<u16>,
    /// What it carries, in order.
    pub carries: Vec<Carried>,
}

/// What a frame can carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Carried {
    /// 6041h.
    Statusword,
    /// 6064h.
    Position,
    /// Positions within the period, less that at its end.
    PositionSteps,
    /// Torque at the handle.
    Torque,
    /// A number that goes up by one with each new torque.
    Counter,
    /// EMG of the flexor carpi radialis.
    EmgFcr,
    /// EMG of the extensor carpi radialis.
    EmgEcr,
}

/// The measured signals: where they are and what their numbers mean.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Signals {
    /// Torque at the handle, resistance to extension positive.
    pub torque: TorqueSignal,
    /// The sample counter; without it only a torque that stands still shows that it is stale.
    #[serde(default)]
    pub counter: Option<CounterSignal>,
    /// Needed where several torques come in a period.
    #[serde(default)]
    pub position_steps: Option<StepsSignal>,
    /// EMG of the flexor carpi radialis.
    #[serde(default)]
    pub emg_fcr: Option<EmgSignal>,
    /// EMG of the extensor carpi radialis.
    #[serde(default)]
    pub emg_ecr: Option<EmgSignal>,
}

/// Handle torque.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TorqueSignal {
    /// The object that is mapped; `null` without CANopen.
    pub object: Option<Object>,
    /// How one number is laid out.
    #[serde(rename = "type")]
    pub kind: DataType,
    /// How many torques of the last period it holds, oldest first, the last one at SYNC.
    pub samples: usize,
    /// N m for each count.
    pub nm_per_count: f64,
    /// The count that says that there is no measurement.
    pub invalid: Option<i64>,
}

/// What is known of each channel.
#[derive(Debug, Clone, PartialEq, Default, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct ChannelsDetails {
    /// The motor angle.
    pub position: ChannelDetails,
    /// The handle torque; its range in N m.
    pub torque: ChannelDetails,
    /// EMG of the flexor carpi radialis; its range in MVC as the rig file scales it.
    pub emg_fcr: ChannelDetails,
    /// EMG of the extensor carpi radialis; its range in MVC as the rig file scales it.
    pub emg_ecr: ChannelDetails,
}

/// EMG.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct EmgSignal {
    /// The object that is mapped; `null` without CANopen.
    pub object: Option<Object>,
    /// How the number is laid out.
    #[serde(rename = "type")]
    pub kind: DataType,
    /// How many values of the last period it holds, oldest first, the last one at SYNC: 1, or as many as torques. A single
    /// value stands for all samples of its period.
    #[serde(default = "one")]
    pub samples: usize,
    /// MVC for each count.
    pub mvc_per_count: f64,
    /// The count that says that there is no measurement.
    pub invalid: Option<i64>,
}

fn one() -> usize {
    1
}

/// Sample counter.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CounterSignal {
    /// The object that is mapped; `null` without CANopen.
    pub object: Option<Object>,
    /// How the number is laid out: `u8`, `u16` or `u32`.
    #[serde(rename = "type")]
    pub kind: DataType,
}

/// Positions within a period.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct StepsSignal {
    /// The object that is mapped.
    pub object: Option<Object>,
    /// How one number is laid out.
    #[serde(rename = "type")]
    pub kind: DataType,
    /// How many, as many as torques.
    pub samples: usize,
}
