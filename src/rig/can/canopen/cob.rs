//! Identifiers of CANopen's pre-defined connection set (CiA 301).

/// NMT module control.
pub const NMT: u16 = 0x000;
/// SYNC.
pub const SYNC: u16 = 0x080;
/// EMCY, plus node.
pub const EMERGENCY: u16 = 0x080;
/// SDO answers, plus node.
pub const SDO_ANSWER: u16 = 0x580;
/// SDO requests, plus node.
pub const SDO_REQUEST: u16 = 0x600;
/// Heartbeat and boot-up, plus node.
pub const HEARTBEAT: u16 = 0x700;
