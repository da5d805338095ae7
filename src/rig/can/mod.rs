//! A motor on a CAN bus: CiA 402 over CANopen, ODrive's CANSimple, or MIT mode.
//!
//! Each layer imports only layers below it:
//!
//! ```text
//! motor              CanMotor is disarmed, ArmedCanMotor moves; between them: limits read back (LimitsConfirmed),
//!                    the dry run (DryRun), the operator's consent (ArmingConsent)
//! connection         the bus, and the adapter of the motor on it
//! safe_state         the way to a safe state and to no power
//! homing_monitor     supervision while the drive moves by itself
//! cycle              target, SYNC, readings, checks; once a period
//! cia402, cansimple, mit     adapters: what each kind of motor is asked and answers
//! drive              trait Drive: what every motor can do
//! pdo_decoder, staleness, limits, sensors, device_setup
//! fault              CanFault, which wraps the errors of the layers below
//! file               the rig file, read and checked
//! canopen            NMT, SDO, PDO, heartbeats, emergencies; CanopenError
//! bus                SocketCAN, SLCAN, socketcand
//! ```

pub mod budget;
pub mod bus;
pub mod canopen;
mod cansimple;
mod cia402;
mod cia402_state;
mod connection;
mod cycle;
mod cycle_stats;
mod device_setup;
mod drive;
mod dry_run;
mod fault;
pub mod file;
mod homing_monitor;
mod limits;
mod mit;
mod motor;
mod pdo_decoder;
mod realtime;
mod safe_state;
pub mod scan;
mod sensors;
mod staleness;
mod summary;
pub mod units;
#[cfg(test)]
mod virtual_bench;

pub use cia402_state::DriveState;
pub use connection::{ConnectError, Connection};
pub use dry_run::DryRun;
pub use fault::CanFault;
pub use limits::{HandleLimits, LimitsConfirmed};
pub use motor::{ArmedCanMotor, CanMotor};
pub use realtime::Privileges;
pub use summary::{DurationSummary, Summary};
