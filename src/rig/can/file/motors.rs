//! The fields of a rig file that describe the motor.

use schemars::JsonSchema;
use serde::Deserialize;

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
    /// To be `true` for a drive without 608Fh: the handle was turned by a known angle, and 6064h changed as `counts_per_revolution` and
    /// `gear_ratio` say.
    #[serde(default)]
    pub counts_checked_by_hand: bool,
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
    /// Angle of the handle where home is found, from the start position, rad. The program adds it; 607Ch of the drive is 0.
    pub offset_rad: f64,
    /// How long it may take, s.
    pub timeout_s: f64,
}

/// Homing methods that take the present position for the origin.
const METHODS_AT_PRESENT_POSITION: [i8; 2] = [35, 37];

impl Homing {
    /// Whether the method takes the present position for the origin, so that the motor does not move.
    pub fn takes_present_position(&self) -> bool {
        METHODS_AT_PRESENT_POSITION.contains(&self.method)
    }
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
