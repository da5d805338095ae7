//! The fields of a rig file. None has a default: what a limb depends on is written down.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::rig::can::bus::{BitRate, BusSpec};
use crate::rig::can::canopen::{DataType, Object};
use crate::rig::{ChannelDetails, StreamSettings};
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
    /// The filter that both angle and torque passed before their numbers are on the bus; the analysis does not filter again.
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

/// The kinds of motors there are.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum MotorSettings {
    /// A CiA 402 drive over CANopen.
    Cia402(Cia402Motor),
    /// An ODrive axis speaking CANSimple.
    Cansimple(CansimpleMotor),
    /// A motor in MIT mode (mini-cheetah, CubeMars AK).
    Mit(MitMotor),
}

/// A CiA 402 drive.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Cia402Motor {
    /// Its node id.
    pub node: u8,
    /// What 1018h must say.
    pub identity: Identity,
    /// Encoder counts of 6064h in one turn of the motor.
    pub counts_per_revolution: u32,
    /// Turns of the motor for one of the handle; negative when they turn opposite ways.
    pub gear_ratio: f64,
    /// Rated torque of the motor (6076h), N m.
    pub rated_torque_nm: f64,
    /// How often it sends its heartbeat (1017h), ms.
    pub heartbeat_ms: u16,
    /// After how long without it the program calls it lost, ms.
    pub heartbeat_wait_ms: u16,
    /// After how long without a target the drive faults by itself (RPDO event timer), ms; 0 for drives without it.
    pub target_wait_ms: u16,
    /// Deceleration of a quick stop (6085h), rad/s2 at the handle.
    pub quick_stop_rad_s2: f64,
    /// How the start position is found.
    pub homing: Homing,
    /// Speed and acceleration on the way to the start position.
    pub go_to_start: GoToStart,
}

/// What a device says of itself in 1018h.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Identity {
    /// Vendor, 1018h:01.
    pub vendor: u32,
    /// Product code, 1018h:02.
    pub product: u32,
}

/// Homing of a CiA 402 drive.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Homing {
    /// 6098h. 35 and 37 take the present position as the start position.
    pub method: i8,
    /// 6099h:01, rad/s at the handle.
    pub fast_rad_s: f64,
    /// 6099h:02, rad/s at the handle.
    pub slow_rad_s: f64,
    /// 609Ah, rad/s2 at the handle.
    pub acceleration_rad_s2: f64,
    /// Angle of the handle where home is found, from the start position, rad (607Ch).
    pub offset_rad: f64,
    /// How long it may take, s.
    pub timeout_s: f64,
}

/// The way to the start position, which the program goes target by target.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GoToStart {
    /// Highest speed, rad/s at the handle.
    pub speed_rad_s: f64,
    /// Acceleration and deceleration, rad/s2 at the handle.
    pub acceleration_rad_s2: f64,
}

/// An ODrive axis. Endpoint numbers are those of the manufacturer's `flat_endpoints.json` for its firmware.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CansimpleMotor {
    /// Its node id, 0 to 62.
    pub node: u8,
    /// Turns of the motor for one of the handle; negative when they turn opposite ways.
    pub gear_ratio: f64,
    /// Torque of the motor for each ampere, N m/A.
    pub torque_constant_nm_per_a: f64,
    /// Firmware that the numbers of the endpoints belong to, such as `0.6.10`; when given, the axis must be of it.
    #[serde(default)]
    pub firmware: Option<String>,
    /// Hardware that they belong to, such as `4.4.58`; when given, the axis must be of it.
    #[serde(default)]
    pub hardware: Option<String>,
    /// Numbers of the endpoints that are written and read back.
    pub endpoints: Endpoints,
    /// How often it reports its state, ms.
    pub heartbeat_ms: u16,
    /// After how long without it the program calls it lost, ms.
    pub heartbeat_wait_ms: u16,
    /// How often it reports position and speed, ms: at least once a period.
    pub encoder_ms: u16,
    /// The motor that the small motions have proved, with a free handle, as the summary of that session names it. Then
    /// arming makes none, and refuses any other motor, firmware or setting that the proof depends on.
    #[serde(default)]
    pub proved_with_free_handle: Option<String>,
    /// Whether the position at the first arming is the start position; if not, the encoder's own zero is.
    pub zero_here: bool,
    /// Speed on the way to the start position, rad/s at the handle.
    pub go_to_start_rad_s: f64,
}

/// Numbers of an ODrive's endpoints.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "named as the manufacturer names them")]
pub struct Endpoints {
    pub heartbeat_msg_rate_ms: u16,
    pub encoder_msg_rate_ms: u16,
    pub enable_watchdog: u16,
    pub watchdog_timeout: u16,
    pub current_soft_max: u16,
    pub torque_soft_max: u16,
    pub vel_limit: u16,
    /// May be left out: the current limit bounds the torque on both sides.
    #[serde(default)]
    pub torque_soft_min: Option<u16>,
    /// `serial_number`, of which the lower 32 bits are read. Without it `proved_with_free_handle` is refused.
    #[serde(default)]
    pub serial_number: Option<u16>,
    /// `axis0.config.motor.torque_constant`, which is only read. Without it the motor is not armed.
    #[serde(default)]
    pub torque_constant: Option<u16>,
}

/// A motor in MIT mode.
#[derive(Debug, Clone, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct MitMotor {
    /// Identifier it listens to.
    pub id: u16,
    /// Identifier it replies with.
    pub reply_id: u16,
    /// Which motor it is: the ranges of its fields are those of the manufacturer's table.
    pub model: MitModel,
    /// Ranges of its firmware where they are not those of the model.
    #[serde(default)]
    pub ranges: Option<MitRanges>,
    /// Turns of the motor's output for one of the handle; negative when they turn opposite ways.
    pub gear_ratio: f64,
    /// Stiffness of its position loop, N m/rad.
    pub kp_nm_per_rad: f64,
    /// Damping of its position loop, N m s/rad.
    pub kd_nm_s_per_rad: f64,
    /// The motor that the small motions have proved, with a free handle, as the summary of that session names it. Then
    /// arming makes none, and refuses any other motor, firmware or setting that the proof depends on.
    #[serde(default)]
    pub proved_with_free_handle: Option<String>,
    /// Whether the position at the first arming is the start position; if not, the encoder's own zero is.
    pub zero_here: bool,
    /// Speed on the way to the start position, rad/s at the handle.
    pub go_to_start_rad_s: f64,
    /// To be `true`: in MIT mode a motor has no limits of its own that could be written or read; only this program's
    /// limits and the watchdog that was set with the manufacturer's tool stand between it and the limb.
    pub has_no_limits_of_its_own: bool,
}

/// Ranges of the fields of a motor in MIT mode; what is left out is that of the model.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MitRanges {
    /// P_MAX: positions go from minus this to this, rad.
    pub position_max_rad: Option<f64>,
    /// V_MAX, rad/s.
    pub speed_max_rad_s: Option<f64>,
    /// KP_MAX: from 0 to this, N m/rad.
    pub kp_max_nm_per_rad: Option<f64>,
    /// KD_MAX: from 0 to this, N m s/rad.
    pub kd_max_nm_s_per_rad: Option<f64>,
    /// T_MAX, N m.
    pub torque_max_nm: Option<f64>,
}

/// A model, with the ranges of the manufacturer's table.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, JsonSchema)]
#[allow(missing_docs, reason = "named as the manufacturer names them")]
pub enum MitModel {
    #[serde(rename = "AK10-9")]
    Ak10_9,
    #[serde(rename = "AK60-6")]
    Ak60_6,
    #[serde(rename = "AK70-10")]
    Ak70_10,
    #[serde(rename = "AK80-6")]
    Ak80_6,
    #[serde(rename = "AK80-9")]
    Ak80_9,
    #[serde(rename = "AK80-80")]
    Ak80_80,
    #[serde(rename = "mini-cheetah")]
    MiniCheetah,
}

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
