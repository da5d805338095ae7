//! Frames of CANSimple: identifier = node << 5 | command, little-endian, position in turns, speed in turns/s.

/// Commands, as the manufacturer names them (ODrive documentation, CAN protocol).
pub mod command {
    pub const GET_VERSION: u16 = 0x00;
    pub const AXIS_HEARTBEAT: u16 = 0x01;
    pub const RX_SDO: u16 = 0x04;
    pub const TX_SDO: u16 = 0x05;
    pub const SET_AXIS_STATE: u16 = 0x07;
    pub const ENCODER_ESTIMATES: u16 = 0x09;
    pub const SET_CONTROLLER_MODE: u16 = 0x0B;
    pub const SET_INPUT_POS: u16 = 0x0C;
    pub const SET_LIMITS: u16 = 0x0F;
    pub const CLEAR_ERRORS: u16 = 0x18;
    pub const SET_ABSOLUTE_POSITION: u16 = 0x19;
}

/// Commands that change what an axis does (ODrive documentation, CAN protocol): emergency stop, node id, parameters, state, mode, inputs,
/// limits, motions, restart, errors, position, gains, update. All others are asked for, or reported.
pub const COMMANDS_TO_AXIS: [u16; 18] = [
    0x02,
    0x06,
    command::RX_SDO,
    command::SET_AXIS_STATE,
    command::SET_CONTROLLER_MODE,
    command::SET_INPUT_POS,
    0x0D,
    0x0E,
    command::SET_LIMITS,
    0x11,
    0x12,
    0x13,
    0x16,
    command::CLEAR_ERRORS,
    command::SET_ABSOLUTE_POSITION,
    0x1A,
    0x1B,
    0x1F,
];

/// Axis state without power.
pub const IDLE: u8 = 1;
/// Axis state that follows targets.
pub const CLOSED_LOOP_CONTROL: u8 = 8;
/// Controller mode: positions.
pub const POSITION_CONTROL: u32 = 3;
/// Input mode: targets are taken as they are.
pub const PASSTHROUGH: u32 = 1;

/// Two numbers of 32 bits, one after the other.
pub fn pair(first: [u8; 4], second: [u8; 4]) -> [u8; 8] {
    let mut data = [0; 8];
    data[..4].copy_from_slice(&first);
    data[4..].copy_from_slice(&second);
    data
}

/// A number of 32 bits in IEEE 754.
pub fn float(value: f64) -> [u8; 4] {
    (value as f32).to_le_bytes()
}
