//! What can go wrong with a motor on a CAN bus, each with a name, what was seen, and what to do.

use serde::Serialize;

use super::canopen::{CanopenError, emergency};
use super::cia402_state::DriveState;
use crate::rig::{Channel, DeviceFault, Exceeded, Fault, FaultClass, Quantity};

/// Why a CAN motor was made safe, or was not armed.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum CanFault {
    /// The frames that answer a SYNC did not arrive in their period.
    #[error(
        "no answer to SYNC in {in_a_row} periods in a row, {tolerated} are tolerated (missing identifier {id:03X}h); \
         check cable, power and load of the bus"
    )]
    MissedCycle {
        /// How many periods.
        in_a_row: u32,
        /// How many the rig file tolerates.
        tolerated: u32,
        /// The identifier that is missing.
        id: u16,
    },
    /// The program did not wake up in time for the next SYNC.
    #[error(
        "the program was {late_us} us late for SYNC in {in_a_row} periods in a row, {tolerated} are tolerated; \
         use a real-time kernel and close other programs"
    )]
    Overrun {
        /// How late.
        late_us: u64,
        /// How many periods.
        in_a_row: u32,
        /// How many the rig file tolerates.
        tolerated: u32,
    },
    /// A frame came twice in one period.
    #[error(
        "frame {id:03X}h arrived {count} times too often, {tolerated} are tolerated; does another device use it?"
    )]
    Duplicated {
        /// Its identifier.
        id: u16,
        /// How often so far.
        count: u64,
        /// How many the rig file tolerates.
        tolerated: u64,
    },
    /// A frame has the wrong length.
    #[error("frame {id:03X}h has {length} bytes instead of {expected}; check the PDO mapping of the device")]
    Malformed {
        /// Its identifier.
        id: u16,
        /// Bytes it has.
        length: u8,
        /// Bytes it should have.
        expected: u8,
    },
    /// A sensor says that it has no measurement.
    #[error("the {channel} channel gave no number; check its cable and amplifier")]
    NotANumber {
        /// Which channel.
        channel: Channel,
    },
    /// The sample counter did not go on by what it must.
    #[error(
        "the sample counter went from {before} to {now}: samples are stale, lost or out of order; check the sensor"
    )]
    StaleSample {
        /// The counter before.
        before: u32,
        /// The counter now.
        now: u32,
    },
    /// The drive is in its fault state, or any but the one it must be in.
    #[error("the drive left OPERATION ENABLED: it is in {state} (statusword {statusword:04X}h)")]
    NotEnabled {
        /// Its state.
        state: DriveState,
        /// The whole statusword.
        statusword: u16,
    },
    /// The drive says that it reached one of its own limits.
    #[error(
        "the drive holds the motion back at one of its limits (statusword {statusword:04X}h); look at 607Dh, 6072h and 6080h"
    )]
    DriveLimit {
        /// The statusword.
        statusword: u16,
    },
    /// The drive or the program sees the motor too far from where it should be.
    #[error(
        "the motor is {error_rad:.4} rad from where it should be, {limit_rad} are allowed; is something in its way?"
    )]
    FollowingError {
        /// How far.
        error_rad: f64,
        /// How far is allowed.
        limit_rad: f64,
    },
    /// Measured angle beyond the rig's limit.
    #[error("the handle is at {angle_rad:.4} rad, beyond the limit of {limit_rad}")]
    Angle {
        /// Where it is.
        angle_rad: f64,
        /// How far is allowed.
        limit_rad: f64,
    },
    /// Measured speed beyond the rig's limit.
    #[error("the handle turns at {speed_rad_s:.3} rad/s, beyond the limit of {limit_rad_s}")]
    Speed {
        /// How fast it is.
        speed_rad_s: f64,
        /// How fast is allowed.
        limit_rad_s: f64,
    },
    /// Measured torque beyond the rig's limit.
    #[error("the torque at the handle is {torque_nm:.3} N m, beyond the limit of {limit_nm}")]
    Torque {
        /// How much it is.
        torque_nm: f64,
        /// How much is allowed.
        limit_nm: f64,
    },
    /// A command from the session that no limit lets through.
    #[error(
        "the session asks for an angle of {angle_rad} rad, beyond the limits {low_rad} to {high_rad} rad; please report this as a bug"
    )]
    CommandBeyondLimit {
        /// What was asked for.
        angle_rad: f64,
        /// Lowest allowed.
        low_rad: f64,
        /// Highest allowed.
        high_rad: f64,
    },
    /// The rig file stretches time, and the motor is not the emulated one.
    #[error("node {node} is not the emulated motor of the test bench: take \"bench\" out of the rig file")]
    NotTheBench {
        /// Which node.
        node: u8,
    },
    /// The drive does not reach a state.
    #[error("the drive does not reach {wanted}: it stays in {state} (statusword {statusword:04X}h, error code {code:04X}h: {})", emergency::description(*code))]
    StateNotReached {
        /// Which state.
        wanted: DriveState,
        /// Where it is.
        state: DriveState,
        /// The whole statusword.
        statusword: u16,
        /// 603Fh.
        code: u16,
    },
    /// Homing failed or took too long.
    #[error(
        "homing did not end within {timeout_s} s (statusword {statusword:04X}h); look at switches, method and speeds"
    )]
    HomingFailed {
        /// How long it was waited for.
        timeout_s: f64,
        /// The statusword.
        statusword: u16,
    },
    /// The drive does not know any more where the start position is.
    #[error(
        "the drive has lost its origin (it was restarted) and its homing method cannot find it: begin the session anew with the handle at the start position"
    )]
    OriginLost,
    /// The motor did not come to the start position.
    #[error(
        "the motor is {off_rad:.4} rad from the start position and does not come nearer; is something in its way?"
    )]
    NotAtStart {
        /// How far it is off.
        off_rad: f64,
    },
    /// A motor without CANopen reports an error or disarmed itself.
    #[error("the motor reports error {code:08X}h and has let go; see its manual")]
    MotorError {
        /// Its error code.
        code: u32,
    },
    /// The power may still be on.
    #[error(
        "it could not be confirmed that the motor has no power: press the emergency stop, then look at the bus"
    )]
    PowerNotConfirmed,
    /// The limits of the session are not those of the dry run.
    #[error(
        "the limits of this session are not those that its movements were checked against; begin the session anew"
    )]
    OtherLimits,
    /// It was made safe before and waits to be armed again.
    #[error("the motor was made safe and waits to be armed again")]
    Latched,
    /// The bus, or a node on it, cannot be used.
    #[error(transparent)]
    #[serde(untagged)]
    Canopen(#[from] CanopenError),
}

impl CanFault {
    /// Which reaction of the rig file applies.
    pub fn class(&self) -> FaultClass {
        match self {
            Self::Canopen(
                CanopenError::BusGone
                | CanopenError::BusOff
                | CanopenError::ControllerError { .. }
                | CanopenError::Garbled { .. }
                | CanopenError::Flood { .. },
            ) => FaultClass::Bus,
            Self::MissedCycle { .. } | Self::Overrun { .. } | Self::Duplicated { .. } => FaultClass::Cycle,
            Self::Malformed { .. } | Self::StaleSample { .. } | Self::NotANumber { .. } => FaultClass::Sensor,
            Self::Angle { .. }
            | Self::Speed { .. }
            | Self::Torque { .. }
            | Self::CommandBeyondLimit { .. } => FaultClass::Limit,
            _ => FaultClass::Drive,
        }
    }

    /// Whether no frame can be sent any more.
    pub(super) fn bus_is_dead(&self) -> bool {
        matches!(self, Self::Canopen(CanopenError::BusGone | CanopenError::BusOff))
    }
}

/// Which fault of the journal a measured quantity beyond its limit is.
impl From<Exceeded> for CanFault {
    fn from(Exceeded { quantity, measured, limit }: Exceeded) -> Self {
        match quantity {
            Quantity::Angle => Self::Angle { angle_rad: measured, limit_rad: limit },
            Quantity::Speed => Self::Speed { speed_rad_s: measured, limit_rad_s: limit },
            Quantity::Torque => Self::Torque { torque_nm: measured, limit_nm: limit },
        }
    }
}

/// Describes the fault for the layers above, which know no CAN. Allocates; call it after the motor was made safe.
impl From<CanFault> for Fault {
    fn from(fault: CanFault) -> Self {
        let mut values = match serde_json::to_value(fault) {
            Ok(serde_json::Value::Object(values)) => values,
            other => unreachable!("a fault serializes to a JSON object, not to {other:?}"),
        };
        let code =
            values.remove("kind").and_then(|code| code.as_str().map(str::to_owned)).unwrap_or_default();
        Self::Device(DeviceFault::new(&code, fault.class(), fault.to_string(), values))
    }
}
