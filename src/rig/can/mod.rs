//! A motor on a CAN bus: CiA 402 over CANopen, ODrive's CANSimple, or MIT mode.
//!
//! ```text
//! rig.json -> file        what is on the bus and what its limits are, checked at the door
//! protocol -> dry_run     every movement of every condition, walked through on paper
//!             motor       CanMotor is disarmed, ArmedCanMotor moves; between them:
//!                         limits read back (Confirmed), the dry run (DryRun), the operator's word
//!             cycle       target, SYNC, readings, checks; once a period
//!             drive       what a motor can do: cia402, cansimple, mit
//!             canopen     NMT, SDO, PDO, heartbeats, emergencies
//!             bus         SocketCAN, SLCAN, socketcand
//!             safe        the way to a safe state and to no power
//! ```

pub mod budget;
pub mod bus;
pub mod canopen;
mod cansimple;
mod cia402;
mod connection;
mod cycle;
mod drive;
mod dry_run;
mod fault;
pub mod file;
mod histogram;
mod limits;
mod lookout;
mod mit;
mod motor;
mod readings;
mod realtime;
mod safe;
pub mod scan;
mod sensors;
mod summary;
pub mod units;

pub use cia402::State as DriveState;
pub use connection::{ConnectError, Connection};
pub use dry_run::DryRun;
pub use fault::CanFault;
pub use histogram::Histogram;
pub use limits::{Confirmed, HandleLimits};
pub use motor::{ArmedCanMotor, CanMotor};
pub use realtime::Privileges;
pub use summary::{Summary, Times};
