//! Opens a bus by its name.

use std::io;

use super::can_bus::CanBus;
use super::slcan;
#[cfg(target_os = "linux")]
use super::socketcan;
use super::socketcand;
use super::spec::{BitRate, BusSpec};

/// Opens the bus that `spec` names.
///
/// # Errors
/// What the operating system or the adapter said.
pub fn open(spec: &BusSpec, bit_rate: BitRate) -> io::Result<Box<dyn CanBus>> {
    match spec {
        BusSpec::Slcan { device } => Ok(Box::new(slcan::Slcan::open(device, bit_rate)?)),
        BusSpec::Socketcand { host, port, channel } => {
            Ok(Box::new(socketcand::Socketcand::open(host, *port, channel)?))
        }
        #[cfg(target_os = "linux")]
        BusSpec::Socketcan { interface } => Ok(Box::new(socketcan::SocketCan::open(interface)?)),
        #[cfg(not(target_os = "linux"))]
        BusSpec::Socketcan { .. } => Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "SocketCAN is Linux's; use a serial adapter (slcan:DEVICE) or a server (socketcand:HOST:PORT:NAME) here",
        )),
    }
}
