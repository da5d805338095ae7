//! Opens a bus by its name.

use std::io;
use std::time::Duration;

use super::can_bus::CanBus;
use super::slcan;
#[cfg(target_os = "linux")]
use super::socketcan;
use super::socketcand;
use super::spec::{BitRate, BusSpec};

/// Opens the bus that `spec` names. A serial adapter is set to `bit_rate`; an interface of Linux must have it already.
/// `send_timeout` is how long a frame may wait for a full transmit queue: shorter than anything that depends on it.
///
/// # Errors
/// What the operating system or the adapter said. It returns in a few seconds, whatever the other side does.
pub fn open(spec: &BusSpec, bit_rate: BitRate, send_timeout: Duration) -> io::Result<Box<dyn CanBus>> {
    match spec {
        BusSpec::Slcan { device } => Ok(Box::new(slcan::Slcan::open(device, bit_rate, send_timeout)?)),
        BusSpec::Socketcand { host, port, channel } => {
            Ok(Box::new(socketcand::Socketcand::open(host, *port, channel, send_timeout)?))
        }
        #[cfg(target_os = "linux")]
        BusSpec::Socketcan { interface } => {
            Ok(Box::new(socketcan::SocketCan::open(interface, bit_rate, send_timeout)?))
        }
        #[cfg(not(target_os = "linux"))]
        BusSpec::Socketcan { .. } => Err(io::Error::new(
            io::ErrorKind::Unsupported,
            "SocketCAN is Linux's; use a serial adapter (slcan:DEVICE) or a server (socketcand:HOST:PORT:NAME) here",
        )),
    }
}
