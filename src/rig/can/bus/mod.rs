//! What carries frames: Linux SocketCAN, a serial adapter, or a socketcand server, behind one small trait.

#[cfg(unix)]
mod ready;
mod slcan;
#[cfg(target_os = "linux")]
mod socketcan;
mod socketcand;
mod spec;

pub use spec::{BitRate, BusSpec, BusSpecError};

use std::fmt;
use std::io;
use std::time::Instant;

use serde::Serialize;

/// A classic CAN data frame with an 11-bit identifier.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Identifier, 0 to 7FFh. A lower one wins the bus.
    pub id: u16,
    length: u8,
    bytes: [u8; 8],
}

impl Frame {
    /// A frame with up to 8 bytes; what is beyond is cut off.
    pub fn new(id: u16, data: &[u8]) -> Self {
        let length = data.len().min(8);
        let mut bytes = [0; 8];
        bytes[..length].copy_from_slice(&data[..length]);
        Self { id: id & 0x7FF, length: length as u8, bytes }
    }

    /// The payload.
    pub fn data(&self) -> &[u8] {
        &self.bytes[..usize::from(self.length)]
    }
}

impl fmt::Display for Frame {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:03X}#", self.id)?;
        self.data().iter().try_for_each(|byte| write!(formatter, "{byte:02X}"))
    }
}

/// What comes from a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// A data frame, and when it arrived.
    Frame(Frame, Instant),
    /// A frame that is no affair of ours: 29-bit identifier, or a remote frame.
    Foreign,
    /// Something that is no frame; a byte was lost between here and the adapter.
    Garbled,
    /// The controller reports on its own health.
    Trouble(Trouble),
}

/// What a CAN controller says of itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Trouble {
    /// A frame was destroyed on the bus, or not acknowledged.
    BusError,
    /// Error counters above 96.
    Warning,
    /// Error counters above 127: the controller may no longer flag errors.
    Passive,
    /// Error counters above 255: the controller has left the bus.
    BusOff,
    /// The controller has come back to the bus.
    Restarted,
    /// Frames were lost because nobody took them in time.
    Overrun,
}

/// A CAN bus: frames out, frames in. Neither may ask for memory once the bus is open.
pub trait CanBus: fmt::Debug + Send {
    /// Hands a frame to the controller.
    ///
    /// # Errors
    /// The frame could not be handed over before the transmit queue's patience ended, or the bus is gone.
    fn send(&mut self, frame: &Frame) -> io::Result<()>;

    /// The next thing that arrives, or `None` when the deadline passes first.
    ///
    /// # Errors
    /// The adapter, server or interface is gone.
    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>>;
}

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
