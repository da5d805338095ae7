//! What can go wrong with a motor on a CAN bus, each with a name, what was seen, and what to do.

use std::mem::{Discriminant, discriminant};

use serde::Serialize;

use super::canopen::{CanopenError, Object, emergency};
use super::cia402_objects::{object_use, remedy};
use super::cia402_state::{DriveState, Statusword};
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
    /// What must be known before there is power did not arrive.
    #[error(
        "the motor was given no power: frame {id:03X}h, which carries measured values, did not come in {in_a_row} periods in a row, \
         {tolerated} are tolerated, and position and torque must be known first; check the cable and supply of the device that \
         sends it, and its TPDO"
    )]
    NotMeasured {
        /// The identifier that is missing.
        id: u16,
        /// In how many periods.
        in_a_row: u32,
        /// How many the rig file tolerates.
        tolerated: u32,
    },
    /// Periods without answer while the motor moves: if it missed their targets, it would jump to the next.
    #[error(
        "no answer to SYNC (missing identifier {id:03X}h) while the target moved by {step_rad:.4} rad: a motor that missed \
         its targets would jump by more than the following error of {limit_rad} rad; check cable and load of the bus"
    )]
    MissedInMotion {
        /// The identifier that is missing.
        id: u16,
        /// From the last target that was answered to the next one, rad.
        step_rad: f64,
        /// The following error that is allowed, rad.
        limit_rad: f64,
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
    #[error("{}; check the sensor", counter_text(*before, *now))]
    StaleSample {
        /// The counter before.
        before: u32,
        /// The counter now.
        now: u32,
    },
    /// The torque did not change, though the samples came.
    #[error(
        "the torque at the handle was {torque_nm} N m to the last digit in {periods} periods, {tolerated} are tolerated: the \
         sensor or its amplifier has stopped; check its cable and supply"
    )]
    FrozenTorque {
        /// The torque, N m.
        torque_nm: f64,
        /// In how many periods.
        periods: u32,
        /// How many the rig file tolerates.
        tolerated: u32,
    },
    /// The EMG of a muscle did not change, though the samples came.
    #[error(
        "the {channel} was {emg_mvc} MVC to the last digit in {periods} periods, {tolerated} are tolerated: the amplifier or its \
         electrode has stopped, and nobody would see whether the muscle is active; check its cable and supply"
    )]
    FrozenEmg {
        /// Which muscle's.
        channel: Channel,
        /// The EMG, MVC as the rig file scales it.
        emg_mvc: f64,
        /// In how many periods.
        periods: u32,
        /// How many the rig file tolerates.
        tolerated: u32,
    },
    /// The drive is in its fault state, or any but the one it must be in.
    #[error("the drive left OPERATION ENABLED: it is in {state} (statusword {statusword:04X}h)")]
    NotEnabled {
        /// Its state.
        state: DriveState,
        /// The whole statusword.
        statusword: u16,
    },
    /// The drive takes its commands from elsewhere.
    #[error(
        "the drive is under local control (statusword {statusword:04X}h: bit 9, remote, is no longer set) and ignores commands from the \
         bus: PRESS THE EMERGENCY STOP. Close the manufacturer's tool, jog panel or local mode that commands it, then arm again"
    )]
    LocalControl {
        /// The statusword.
        statusword: u16,
    },
    /// The drive says that it reached one of its own limits, or that the motor is too far from its target.
    #[error("the drive holds the motion back {} (statusword {statusword:04X}h)", held_back_by(*statusword))]
    DriveLimit {
        /// The statusword.
        statusword: u16,
    },
    /// The drive says that it does not follow its target.
    #[error(
        "the drive does not follow the target (statusword {statusword:04X}h: bit 12 is not set); look whether it is in \
         cyclic synchronous position mode (6061h is 8), and whether its firmware sets bit 12 in this mode"
    )]
    TargetIgnored {
        /// The statusword.
        statusword: u16,
    },
    /// A drive lacks an object that is needed.
    #[error("node {node} has no object {index:04X}h:{sub:02X}, which is needed: {}; {}; ramphold rig check lists all", without(*index, *sub), remedy(*index))]
    ObjectMissing {
        /// Which node.
        node: u8,
        /// The object.
        index: u16,
        /// Its entry.
        sub: u8,
    },
    /// A unit or scale of the drive is not that of the rig file.
    #[error("node {node} says that object {index:04X}h:{sub:02X} is {read:08X}h, and {expected:08X}h is expected: {}", remedy(*index))]
    WrongUnit {
        /// Which node.
        node: u8,
        /// The object.
        index: u16,
        /// Its entry.
        sub: u8,
        /// What it reads.
        read: u32,
        /// What the rig file counts on.
        expected: u32,
    },
    /// The motor moves faster than it was told.
    #[error(
        "the handle turns at {measured_rad_s:.3} rad/s where {asked_rad_s} rad/s were asked for: the drive does not take \
         speeds or targets in the unit of its position (607Eh, 6091h, 6092h, 60A9h), or something else moves the handle"
    )]
    FasterThanAsked {
        /// How fast it is.
        measured_rad_s: f64,
        /// How fast it should be at most.
        asked_rad_s: f64,
    },
    /// The motor did not move as far as it was told.
    #[error(
        "the handle moved by {moved_rad:.5} rad where {asked_rad:.5} rad were asked for: the drive does not take its targets in \
         the unit of its position (607Eh, 6091h, 6092h), or something holds the handle"
    )]
    MovedOtherwise {
        /// How far it moved, in the direction that was asked for.
        moved_rad: f64,
        /// How far it should have moved.
        asked_rad: f64,
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
    /// A target that steps further, or changes its speed more, than the limits allow.
    #[error(
        "a target asks for {speed_rad_s:.3} rad/s and {acceleration_rad_s2:.0} rad/s2, the limits are {most_rad_s} rad/s and \
         {most_rad_s2} rad/s2; it was not sent. Please report this as a bug"
    )]
    CommandTooFast {
        /// Speed of the step, rad/s.
        speed_rad_s: f64,
        /// Change of the speed in the period, rad/s2.
        acceleration_rad_s2: f64,
        /// Highest speed allowed, rad/s.
        most_rad_s: f64,
        /// Highest acceleration allowed, rad/s2.
        most_rad_s2: f64,
    },
    /// A target was to be sent in a state in which none may be.
    #[error(
        "a target was to be sent while the motor was {state}; it was not sent. Please report this as a bug"
    )]
    TargetNotAllowed {
        /// The state of the motor.
        state: &'static str,
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
    /// The handle went further in a search for its home than there can be room for.
    #[error(
        "the handle moved by {moved_rad:.3} rad while the motor searched its home, and {most_rad:.3} rad are the most between the angle \
         limits and home: the motor was stopped. Look at home switch, cable, method (6098h), homing.offset_rad and counts_per_revolution"
    )]
    HomingTooFar {
        /// How far, rad at the handle.
        moved_rad: f64,
        /// How far at most, rad at the handle.
        most_rad: f64,
    },
    /// The drive does not know any more where the start position is.
    #[error(
        "the drive has lost its origin (it was restarted, or its position sensor failed) and its homing method cannot find it: begin the session anew with the handle at the start position"
    )]
    OriginLost,
    /// The handle moved in a homing that takes its present place for the start position.
    #[error(
        "homing takes the present position for the start position, and must not move the motor; it moved by {moved_rad:.4} rad \
         meanwhile. Look whether 6098h of the drive means what the rig file means by its method, and hold the handle still"
    )]
    MovedWhileHoming {
        /// How far, rad at the handle.
        moved_rad: f64,
    },
    /// After homing the drive counts from another place than it was told.
    #[error(
        "after homing the drive has the handle at {angle_rad:.4} rad, and {expected_rad:.4} rad (607Ch) are right: all movements and \
         limits would be shifted. Look at the homing offset in the drive's manual, and at its encoder"
    )]
    OriginMisplaced {
        /// Where the drive has the handle, rad.
        angle_rad: f64,
        /// Where it must have it, rad.
        expected_rad: f64,
    },
    /// The motor that is armed again may have another origin than before.
    #[error(
        "the motor has the handle at {angle_rad:.4} rad, and is armed again only where the handle stands at the start position: it \
         cannot show that it was not restarted, and its angles may mean something else than before. Put the handle where it stood \
         when the session began. If the motor does not read 0 there, it has lost its origin: end the session and resume it with \
         --home-here"
    )]
    OriginNotConfirmed {
        /// Where the motor has the handle, rad.
        angle_rad: f64,
    },
    /// The motor did not take the start position that it was told.
    #[error(
        "the motor was told that the handle stands at the start position, and has it at {angle_rad:.4} rad: it does not take an \
         origin (Set_Absolute_Position), or somebody moves the handle. Leave the handle alone and arm again; if that does not \
         help, update the motor's firmware, or use zero_here: false with an absolute encoder"
    )]
    OriginNotTaken {
        /// Where the motor has the handle, rad.
        angle_rad: f64,
    },
    /// The motor did not come to the start position.
    #[error(
        "the motor is {off_rad:.4} rad from the start position and does not come nearer; is something in its way?"
    )]
    NotAtStart {
        /// How far it is off.
        off_rad: f64,
    },
    /// A position that no shaft within the speed limit can have reached since the last one.
    #[error(
        "the motor reports a position {jump_rad:.4} rad from the last one, where {limit_rad:.4} rad are possible; it was not \
         used. Check the encoder and its cable"
    )]
    PositionJump {
        /// How far from the last believed position, rad at the handle.
        jump_rad: f64,
        /// How far the speed limit lets it be, rad at the handle.
        limit_rad: f64,
    },
    /// A number at, or beyond, the end of its field in MIT mode.
    #[error(
        "the motor's {field} is at the end of its field ({limit}), where it says nothing; compare ranges in the rig file with \
         those of the motor's firmware"
    )]
    FieldSaturated {
        /// Which field.
        field: &'static str,
        /// The end of its range, in the field's unit.
        limit: f64,
    },
    /// The limits lie beyond what the motor's fields can say.
    #[error(
        "the limits need a {what} of {needed:.3} at the motor, its field ends at {range}; use tighter limits, or another gear"
    )]
    BeyondMotorRange {
        /// Which field.
        what: &'static str,
        /// What the limits need, in the field's unit.
        needed: f64,
        /// The end of its range.
        range: f64,
    },
    /// Within the limits of its motion, a motor in MIT mode could make more torque than its limit.
    #[error(
        "motor.kp_nm_per_rad and kd_nm_s_per_rad are too high for limits.motor_torque_nm: in three periods a shaft within the \
         limits of speed and acceleration can be so far from where it is expected that they make {of_kp_nm:.2} + {of_kd_nm:.2} \
         N m; {most_nm:.2} may be needed for that, half of the limit. Lower kp and kd, shorten period_us, or lower the \
         acceleration limit; where the motor has no more than {has_nm:.1} N m anyway and that is safe, let the limit be that"
    )]
    GainsTooHigh {
        /// What the stiffness makes, N m at the handle.
        of_kp_nm: f64,
        /// What the damping makes, N m at the handle.
        of_kd_nm: f64,
        /// What both may make, N m at the handle.
        most_nm: f64,
        /// What the motor has, N m at the handle.
        has_nm: f64,
    },
    /// Position and speed that the motor reports do not fit each other, or the motion before.
    #[error(
        "the motor reports a speed of {reported_rad_s:.3} rad/s while its position turns at {measured_rad_s:.3} rad/s since the last \
         reply that fitted the motion before it, and several in a row do not, within the acceleration limit: the handle was struck, \
         frames are corrupt, or ranges in the rig file are not those of the motor's firmware"
    )]
    SpeedDisagrees {
        /// What it reports, rad/s at the motor.
        reported_rad_s: f64,
        /// Slope of its position, rad/s at the motor.
        measured_rad_s: f64,
    },
    /// The rig file says that the small motions were made with another motor, or with other settings.
    #[error(
        "proved_with_free_handle in the rig file is not of this motor, its firmware and its settings; take the line out, let go of the \
         handle and arm: the summary of that session gives the line of this motor"
    )]
    ProofOfOtherMotor,
    /// The rig file says which motor was proved, and the motor on the bus does not tell which it is.
    #[error(
        "proved_with_free_handle needs endpoints.serial_number in the rig file: without it another motor would pass for the one \
         that was proved. Give its number, or take proved_with_free_handle out and let go of the handle before arming"
    )]
    ProofWithoutSerialNumber,
    /// The small motion before arming shows that the ranges of the rig file are not those of the motor.
    #[error(
        "in the small motion before arming the {what} is {measured:.4} where the ranges of the rig file make it {expected:.4}: \
         motor.ranges are not those of the motor's firmware; look them up with the manufacturer's tool"
    )]
    WrongScale {
        /// What was compared.
        what: &'static str,
        /// What the motor reports.
        measured: f64,
        /// What it should report.
        expected: f64,
    },
    /// The small motion before arming has no room.
    #[error(
        "the small motion that proves the motor needs {needed_rad:.4} rad, there are {room_rad:.4} rad to the angle limit; \
         bring the handle nearer to the middle of its range"
    )]
    NoRoomForProof {
        /// What it needs, rad at the handle.
        needed_rad: f64,
        /// What there is, rad at the handle.
        room_rad: f64,
    },
    /// The handle moves although the motor has no power.
    #[error(
        "the handle does not come to rest before the small motion that proves the motor; let go of it, then arm again"
    )]
    HandleNotAtRest,
    /// The shaft did not move in the small motion before arming.
    #[error(
        "in the small motion that proves the motor the handle moved by {moved_rad:.5} rad, {needed_rad:.5} are needed; let go of \
         the handle and free it. A motor whose friction is stronger than this motion cannot be proved, and is not armed"
    )]
    NotMovedForProof {
        /// How far, rad at the handle.
        moved_rad: f64,
        /// How far it must, rad at the handle.
        needed_rad: f64,
    },
    /// The motor's own watchdog was not seen to act.
    #[error(
        "the motor was left without a command for {silent_ms} ms and did not let go: its own watchdog is off, or longer than \
         motor_waits_ms ({motor_waits_ms}). Without it nothing stops the motor when the program dies. Set it with the \
         manufacturer's tool (MIT: CAN timeout), then arm again"
    )]
    WatchdogNotSeen {
        /// What the rig file says, ms.
        motor_waits_ms: u64,
        /// How long the program was silent, ms.
        silent_ms: u64,
    },
    /// The motor's firmware or hardware is not the one of the rig file.
    #[error(
        "the ODrive's {what} is {}.{}.{}, the rig file's endpoints are those of {}.{}.{}; take the numbers from the \
         flat_endpoints.json of its own firmware", read[0], read[1], read[2], expected[0], expected[1], expected[2]
    )]
    WrongVersion {
        /// Firmware or hardware.
        what: &'static str,
        /// What the motor says.
        read: [u8; 3],
        /// What the rig file says.
        expected: [u8; 3],
    },
    /// The motor does not tell its version, which the rig file gives.
    #[error(
        "the ODrive does not tell its version (Get_Version), which the rig file gives; is its firmware older than 0.6?"
    )]
    VersionUnknown,
    /// An endpoint is not the one that the rig file means.
    #[error(
        "endpoint {endpoint} is not {name}: it reads {read} where {expected} is right. The endpoints are those of another \
         firmware; take the numbers from the flat_endpoints.json of this one. No limit was written to it"
    )]
    WrongEndpoint {
        /// Its number.
        endpoint: u16,
        /// What it is called.
        name: &'static str,
        /// What it reads.
        read: f32,
        /// What it must read.
        expected: f32,
    },
    /// The torque constant of the motor is not that of the rig file.
    #[error(
        "the ODrive's torque constant is {read} N m/A, the rig file's is {expected}: with the wrong one every torque limit is \
         wrong. Measure it, and correct the one that is wrong"
    )]
    WrongTorqueConstant {
        /// What the motor says, N m/A.
        read: f64,
        /// What the rig file says, N m/A.
        expected: f64,
    },
    /// The rig file does not say where the torque constant is read.
    #[error(
        "the ODrive's torque constant cannot be compared with the rig file's, so its torque has no limit that is sure: add \
         motor.endpoints.torque_constant (axis0.config.motor.torque_constant in flat_endpoints.json)"
    )]
    TorqueConstantUnknown,
    /// A motor without CANopen reports an error or disarmed itself.
    #[error("the motor reports error {code:08X}h and has let go; see its manual")]
    MotorError {
        /// Its error code.
        code: u32,
    },
    /// The drive does not begin the quick stop that it was told.
    #[error(
        "the drive was told to make a quick stop and did not begin it in {periods} periods; its power was taken instead. It must not be \
         used before it was found out why: look at 605Ah, and at the controlword in its receive PDO"
    )]
    QuickStopIgnored {
        /// Periods whose readings showed that.
        periods: u32,
    },
    /// The handle does not become slower on the drive's quick-stop ramp.
    #[error(
        "the drive says that it makes a quick stop, but the handle turns at {measured_rad_s:.3} rad/s, where it should have slowed down to \
         {limit_rad_s:.3} rad/s; its power was taken instead. Look at 6085h and 605Ah of the drive"
    )]
    NotBraking {
        /// How fast it is, rad/s.
        measured_rad_s: f64,
        /// How fast it may be by then, rad/s.
        limit_rad_s: f64,
    },
    /// The drive keeps its power although it was told to switch it off.
    #[error(
        "the drive kept its power for {periods} periods after it was told to switch it off: PRESS THE EMERGENCY STOP. The program has ended \
         its heartbeat and stopped the node, so that the drive's own watchdog may act"
    )]
    PowerKept {
        /// Periods whose readings showed that.
        periods: u32,
    },
    /// The drive kept its power although it was told over SDO to switch it off, until it was left to its own watchdog.
    #[error(
        "the drive kept its power for {waited_ms} ms after it was told to switch it off, and let go only when the program had ended its \
         heartbeat and stopped the node. It must not be used before it was found out why: look whether the drive takes its controlword \
         from elsewhere"
    )]
    PowerOffIgnored {
        /// How long it was waited for, ms.
        waited_ms: u64,
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
                | CanopenError::OtherMaster { .. }
                | CanopenError::Flood { .. },
            ) => FaultClass::Bus,
            Self::MissedCycle { .. }
            | Self::NotMeasured { .. }
            | Self::MissedInMotion { .. }
            | Self::Overrun { .. }
            | Self::Duplicated { .. } => FaultClass::Cycle,
            Self::Malformed { .. }
            | Self::StaleSample { .. }
            | Self::FrozenTorque { .. }
            | Self::FrozenEmg { .. }
            | Self::NotANumber { .. } => FaultClass::Sensor,
            Self::Angle { .. }
            | Self::Speed { .. }
            | Self::Torque { .. }
            | Self::CommandBeyondLimit { .. }
            | Self::CommandTooFast { .. }
            | Self::TargetNotAllowed { .. } => FaultClass::Limit,
            _ => FaultClass::Drive,
        }
    }

    /// Which fault it is, whatever its numbers.
    pub(super) fn kind(&self) -> FaultKind {
        let of_bus = match self {
            Self::Canopen(error) => Some(discriminant(error)),
            _ => None,
        };
        FaultKind(discriminant(self), of_bus)
    }

    /// Whether no frame can be sent any more.
    pub(super) fn bus_is_dead(&self) -> bool {
        matches!(self, Self::Canopen(CanopenError::BusGone | CanopenError::BusOff))
    }
}

/// A fault without its numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct FaultKind(Discriminant<CanFault>, Option<Discriminant<CanopenError>>);
/// What a sample counter did instead of going on by one.
fn counter_text(before: u32, now: u32) -> String {
    if before == now {
        return format!(
            "the sample counter went from {before} to {now}: it stands, and the same sample came again"
        );
    }
    format!("the sample counter went from {before} to {now}: samples were lost or came out of order")
}

/// What a statusword with bit 11 or 13 says.
fn held_back_by(statusword: u16) -> &'static str {
    if Statusword(statusword).internal_limit() {
        return "at one of its limits: bit 11 is set; look at 607Dh, 6072h and 6080h";
    }
    "for it sees a following error: bit 13 is set; is something in the motor's way? See 6065h and 6066h"
}

fn without(index: u16, sub: u8) -> &'static str {
    object_use(Object { index, sub }).map_or("the program relies on it", |row| row.without)
}

/// Which fault of the journal a measured quantity beyond its limit is.
impl From<Exceeded> for CanFault {
    fn from(Exceeded { quantity, measured, limit }: Exceeded) -> Self {
        match quantity {
            _ if !measured.is_finite() => Self::NotANumber { channel: quantity.channel() },
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn fault_with_a_number_that_is_not_finite_can_be_read_from_a_journal() {
        for fault in [
            CanFault::Angle { angle_rad: f64::NAN, limit_rad: 0.2 },
            CanFault::PositionJump { jump_rad: f64::INFINITY, limit_rad: 0.1 },
        ] {
            let fault = Fault::from(fault);
            let text = serde_json::to_string(&fault).unwrap();
            assert!(!text.contains("null"), "{text}");
            assert_eq!(serde_json::from_str::<Fault>(&text).unwrap(), fault);
        }
        let exceeded = Exceeded { quantity: Quantity::Angle, measured: f64::NAN, limit: 0.2 };
        assert_eq!(CanFault::from(exceeded), CanFault::NotANumber { channel: Channel::Angle });
    }
}
