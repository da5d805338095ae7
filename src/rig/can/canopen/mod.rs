//! CANopen (CiA 301) from the master's side: NMT, SYNC, heartbeats, SDO, PDO configuration, emergencies.

pub mod abort;
mod device;
pub mod emergency;
mod link;
mod nmt;
mod object;
pub mod pdo;
mod sdo;

pub(super) use device::{expect, identify, write_tpdos};
pub use link::{Beat, Counters, Link, Producer, Strictness};
pub use nmt::{NmtCommand, NmtState};
pub use object::{Kind, Object, Value};

/// Identifiers of the pre-defined connection set.
pub mod cob {
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
}
