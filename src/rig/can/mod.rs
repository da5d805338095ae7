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
//! motor_state        the table of states: targets that may be sent, checks that run, what a fault leads to
//! target_guard, target_motion    the last check of every target; how targets come to rest
//! cia402, cansimple, mit     adapters: what each kind of motor is asked and answers
//! motion_proof       whether the motor moves as far and as fast as it is told
//! drive              trait Drive: what every motor can do
//! pdo_decoder, staleness, limits, sensors, device_setup
//! proved_motor       which motor the small motions of arming have proved
//! finding            objects of a drive that are missing or refuse, from the table cia402_objects
//! fault              CanFault, which wraps the errors of the layers below
//! file               the rig file, read and checked
//! canopen            NMT, SDO, PDO, heartbeats, emergencies; CanopenError
//! bus                SocketCAN, SLCAN, socketcand
//! ```

mod braking_watch;
pub mod budget;
pub mod bus;
pub mod canopen;
mod cansimple;
mod cia402;
pub mod cia402_objects;
mod cia402_state;
mod connection;
mod cycle;
mod cycle_stats;
mod device_setup;
mod drive;
mod dry_run;
mod fault;
pub mod file;
mod finding;
mod homing_monitor;
mod limits;
mod mit;
mod motion_proof;
mod motor;
mod motor_state;
mod origin;
mod pdo_decoder;
mod position_check;
mod proved_motor;
mod realtime;
mod safe_state;
pub mod scan;
mod sensors;
mod staleness;
mod summary;
mod target_guard;
mod target_motion;
pub mod units;
#[cfg(test)]
mod virtual_bench;

pub use cia402_state::DriveState;
pub use connection::{ConnectError, Connection};
pub use dry_run::DryRun;
pub use fault::CanFault;
pub use finding::{ObjectFinding, ObjectProblem};
pub use limits::{HandleLimits, LimitsConfirmed};
pub use motor::{ArmedCanMotor, CanMotor};
pub use motor_state::{AllowedTargets, Check, MotorState, OnFault, STATES, StateRule};
pub use origin::{OriginError, ResumedOrigin};
pub use realtime::Privileges;
pub use summary::{DurationSummary, Summary};
