//! Emergency messages (EMCY, CiA 301): error code, error register, five bytes of the manufacturer's.

/// Whether an error code of CiA 402 is that of a sensor by which a drive knows its position: tachometers, resolvers, encoders (7300h to
/// 7307h), and a wrong position (7320h).
pub fn is_sensor_error(code: u16) -> bool {
    matches!(code, 0x7300..=0x7307 | 0x7320)
}

/// The meaning of an emergency error code: CiA 301, and CiA 402 for what concerns drives.
pub fn description(code: u16) -> &'static str {
    let exact = match code {
        0x2310 => "continuous over-current",
        0x2320 => "short circuit or earth leakage",
        0x2330 => "earth leakage",
        0x3110 => "mains over-voltage",
        0x3120 => "mains under-voltage",
        0x3210 => "DC link over-voltage",
        0x3220 => "DC link under-voltage",
        0x4210 => "drive too hot",
        0x4220 => "drive too cold",
        0x4310 => "motor too hot",
        0x5112 => "logic supply too low",
        0x5441 => "contactor or STO opened",
        0x5530 => "storage of parameters failed",
        0x6010 => "software reset by its watchdog",
        0x6320 => "parameter error",
        0x7121 => "motor blocked",
        0x7300 => "sensor error",
        0x7305 => "encoder 1 error",
        0x7306 => "encoder 2 error",
        0x7500 => "communication error",
        0x8110 => "CAN overrun: frames were lost",
        0x8120 => "CAN error passive",
        0x8130 => "heartbeat or life guard lost",
        0x8140 => "recovered from bus-off",
        0x8150 => "identifier collision",
        0x8210 => "PDO not processed: too short",
        0x8220 => "PDO too long",
        0x8240 => "SYNC of unexpected length",
        0x8250 => "RPDO timed out",
        0x8331 => "torque limit",
        0x8400 => "speed beyond its limit",
        0x8500 | 0x8600 => "position control error",
        0x8611 => "following error",
        0x8612 => "position limit reached",
        0xFF06 => "limit switch",
        _ => "",
    };
    if !exact.is_empty() {
        return exact;
    }
    match code >> 8 {
        0x00 => "error reset or no error",
        0x10 => "generic error",
        0x20..=0x23 => "current",
        0x30..=0x33 => "voltage",
        0x40..=0x44 => "temperature",
        0x50..=0x5F => "hardware of the device",
        0x60..=0x63 => "software of the device",
        0x70..=0x7F => "an additional module",
        0x80 => "monitoring",
        0x81 => "communication",
        0x82 => "protocol error",
        0x83 => "torque control",
        0x84 => "speed control",
        0x85 | 0x86 => "position control",
        0x90 => "external error",
        0xF0 => "additional functions",
        0xFF => "specific to the device; see its manual",
        _ => "reserved; see the device's manual",
    }
}

/// The code and the error register of an emergency's payload.
pub fn parse(data: &[u8]) -> Option<(u16, u8)> {
    match data {
        [low, high, register, ..] => Some((u16::from_le_bytes([*low, *high]), *register)),
        _ => None,
    }
}
