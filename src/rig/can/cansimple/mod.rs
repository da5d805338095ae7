//! ODrive's CANSimple.
//!
//! ```text
//! adapter     what the cycle asks of an axis
//! watchdog    the axis's own watchdog is seen to act
//! endpoints   parameters by number: proved, written, read back
//! axis        what it was told, what it reported
//! estimates   the position at SYNC, from reports by the axis's own clock
//! frame       commands and numbers
//! ```

mod adapter;
mod axis;
mod endpoints;
mod estimates;
mod frame;
mod watchdog;

pub use axis::Cansimple;
pub use frame::COMMANDS_TO_AXIS;
