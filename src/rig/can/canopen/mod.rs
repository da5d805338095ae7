//! CANopen (CiA 301) from the master's side: NMT, SYNC, heartbeats, SDO, PDO configuration, emergencies.

pub mod cob;
pub mod emergency;
mod error;
mod link;
mod nmt;
mod object;
mod own_commands;
pub mod pdo;
mod sdo;
pub mod sdo_abort;

pub use error::CanopenError;
pub use link::{Counters, ErrorPolicy, Link, MonitoredNode, OwnHeartbeat};
pub use nmt::{NmtCommand, NmtState};
pub use object::{DataType, Object, Value};
pub use own_commands::OwnCommands;
