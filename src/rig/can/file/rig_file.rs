//! The fields of a rig file. None has a default: what a limb depends on is written down.

use schemars::JsonSchema;
use serde::Deserialize;

use super::motors::MotorSettings;
use super::signals::{ChannelsDetails, FrameLayout, Sensor, Signals};
use crate::rig::StreamSettings;
use crate::rig::can::bus::{BitRate, BusSpec};
use crate::rig::can::canopen::{DataType, Object};
use crate::signal::FilterSpec;
use crate::wrist::Lever;

/// Format and version of the rig files that this program reads.
pub const RIG_FORMAT: &str = "ramphold-rig/1";

/// A rig, as written in a rig file.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CanRigFile {
    /// `can`: what kind of rig it is.
    pub kind: RigKind,
    /// Format and version: `ramphold-rig/1`.
    #[schemars(extend("const" = RIG_FORMAT))]
    pub format: String,
    /// A name for people.
    pub name: String,
    /// Where the bus is, such as `socketcan:can0`.
    pub bus: BusSpec,
    /// Its bit rate, bit/s. An interface of Linux must have it already.
    pub bit_rate: BitRate,
    /// Time from one SYNC to the next, us.
    pub period_us: u32,
    /// What this program is on the bus.
    pub master: Master,
    /// The lever between motor and handle, which the analysis needs; `null` for a rigid one.
    #[serde(deserialize_with = "Option::deserialize")]
    pub lever: Option<Lever>,
    /// The motor.
    pub motor: MotorSettings,
    /// CANopen devices that measure, beside the motor.
    #[serde(default)]
    pub sensors: Vec<Sensor>,
    /// The frames that come with each SYNC.
    pub frames: Vec<FrameLayout>,
    /// What is in them.
    pub signals: Signals,
    /// What is known of the channels before their numbers are on the bus: delay, filters, range, origin.
    #[serde(default)]
    pub channels: ChannelsDetails,
    /// The filter that both angle and torque passed before their numbers are on the bus; the analysis takes it out of both and filters with it.
    /// Without it, none.
    #[serde(default)]
    pub recorded_filter: Option<FilterSpec>,
    /// Streams of Lab Streaming Layer, such as that of an EMG amplifier, that are recorded with the session.
    #[serde(default)]
    pub streams: Vec<StreamSettings>,
    /// A display on the bus that shows the person the target; without it they look at the console.
    #[serde(default)]
    pub display: Option<Display>,
    /// What the handle may never exceed.
    pub limits: RigLimits,
    /// What the motor does after a fault.
    pub safe_state: SafeStates,
    /// How much of what goes wrong is let pass.
    pub tolerate: Tolerances,
    /// Only for the emulated motor of the test bench.
    #[serde(default)]
    pub bench: Option<BenchSettings>,
}

/// The only kind of rig that this file describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum RigKind {
    /// A motor on a CAN bus.
    Can,
}

/// This program as a CANopen node.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Master {
    /// Its node id.
    pub node: u8,
    /// How often it sends its heartbeat, ms.
    pub heartbeat_ms: u16,
    /// After how long without it the motor stops by itself, ms.
    pub motor_waits_ms: u16,
}

/// A display on the bus, written with each target.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Display {
    /// The object.
    pub object: Object,
    /// How the number is laid out.
    #[serde(rename = "type")]
    pub kind: DataType,
    /// N m for each count.
    pub nm_per_count: f64,
    /// What is shown for a maximal effort, N m.
    pub effort_nm: f64,
}

/// What the handle may never exceed.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RigLimits {
    /// Lowest and highest angle from the start position, rad (607Dh).
    pub angle_rad: [f64; 2],
    /// Highest speed, rad/s (6080h).
    pub speed_rad_s: f64,
    /// Highest acceleration of a planned movement, rad/s2.
    pub acceleration_rad_s2: f64,
    /// Highest measured torque, N m, either sign.
    pub torque_nm: f64,
    /// Highest torque of the motor at the handle, N m (6072h).
    pub motor_torque_nm: f64,
    /// How far the handle may be from where it should be, rad (6065h).
    pub following_error_rad: f64,
    /// For how long it may be, ms (6066h).
    pub following_error_ms: u16,
}

/// What the motor does after a fault of each class.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct SafeStates {
    /// A measured quantity beyond its limit.
    pub limit: SafeState,
    /// A sensor that gives no number, or an old one.
    pub sensor: SafeState,
    /// The drive does not do as it is told.
    pub drive: SafeState,
    /// The bus is in trouble.
    pub bus: SafeState,
    /// Frames or wake-ups came late.
    pub cycle: SafeState,
}

/// What a motor does to be safe. All end without power.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SafeState {
    /// Stop on the quick-stop ramp, then no power.
    QuickStop,
    /// Stay where it is for half a second, watched, so that the person can let go; then no power.
    Hold,
    /// No power at once.
    TorqueOff,
}

/// How much of what goes wrong is let pass before it is a fault. With a person at the handle, nothing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Tolerances {
    /// Periods in a row whose frames came too late, or in which the program woke up too late.
    pub missed_cycles_in_a_row: u32,
    /// Frames that came twice, in all.
    pub duplicate_frames: u64,
    /// Frames of others each second.
    pub foreign_frames_per_s: u32,
    /// Error frames, in all.
    pub error_frames: u64,
    /// Bytes that are no frames, in all.
    pub garbled_frames: u64,
    /// Periods in a row in which the torque may be the same to the last digit.
    pub unchanged_torque_periods: u32,
    /// Periods in a row in which the EMG of a muscle may be the same to the last digit; without it, EMG that has frozen is only
    /// found when the session is analysed. A protocol whose gate rests on the antagonist's EMG needs it.
    #[serde(default)]
    pub unchanged_emg_periods: Option<u32>,
}

/// For the emulated motor, whose time moves with SYNC.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct BenchSettings {
    /// How many times slower than `period_us` the cycle runs.
    pub time_stretch: f64,
}
