//! Abort codes of SDO transfers (CiA 301) in words.

/// What an abort code means.
pub fn description(code: u32) -> &'static str {
    match code {
        0x0503_0000 => "toggle bit not alternated",
        0x0504_0000 => "SDO protocol timed out",
        0x0504_0001 => "command specifier not valid or unknown",
        0x0504_0005 => "out of memory",
        0x0601_0000 => "unsupported access to an object",
        0x0601_0001 => "object is write only",
        0x0601_0002 => "object is read only",
        0x0602_0000 => "object does not exist",
        0x0604_0041 => "object cannot be mapped into a PDO",
        0x0604_0042 => "mapped objects exceed the PDO's length",
        0x0604_0043 => "parameter incompatible",
        0x0604_0047 => "internal incompatibility of the device",
        0x0606_0000 => "hardware error",
        0x0607_0010 => "length of the parameter does not match",
        0x0607_0012 => "parameter too long",
        0x0607_0013 => "parameter too short",
        0x0609_0011 => "sub-index does not exist",
        0x0609_0030 => "value outside its range",
        0x0609_0031 => "value too high",
        0x0609_0032 => "value too low",
        0x0609_0036 => "maximum below minimum",
        0x060A_0023 => "resource not available",
        0x0800_0000 => "general error",
        0x0800_0020 => "data cannot be stored",
        0x0800_0021 => "data cannot be stored: local control",
        0x0800_0022 => "data cannot be stored: present state of the device",
        0x0800_0023 => "no object dictionary present",
        0x0800_0024 => "no data available",
        _ => "a code of the manufacturer's",
    }
}
