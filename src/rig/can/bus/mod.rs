//! CAN buses: Linux SocketCAN, a serial adapter (SLCAN), or a socketcand server, behind one small trait.

#[cfg(target_os = "linux")]
mod arrival;
mod can_bus;
mod frame;
#[cfg(target_os = "linux")]
mod netlink;
mod open;
#[cfg(unix)]
mod readiness;
mod slcan;
mod slcan_line;
#[cfg(target_os = "linux")]
mod socketcan;
mod socketcand;
mod spec;

pub use can_bus::{Arrival, CanBus, ControllerError, Received};
pub use frame::Frame;
pub use open::open;
pub use spec::{BitRate, BusSpec, BusSpecError};
