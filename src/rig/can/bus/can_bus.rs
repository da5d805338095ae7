//! The trait of everything that carries frames, and what arrives from it.

use std::fmt;
use std::io;
use std::time::Instant;

use serde::Serialize;

use super::frame::Frame;

/// When a frame arrived: between two times, since an adapter without stamps tells only when it was read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Arrival {
    /// What was there before was read.
    pub earliest: Instant,
    /// It was there.
    pub latest: Instant,
}

impl Arrival {
    /// Of a frame with a stamp.
    pub fn at(stamp: Instant) -> Self {
        Self { earliest: stamp, latest: stamp }
    }
}

/// What comes from a bus.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Received {
    /// A data frame, and when it arrived.
    Frame(Frame, Arrival),
    /// A frame that the program does not use: 29-bit identifier, or a remote frame.
    Foreign,
    /// Something that is no frame; a byte was lost between here and the adapter.
    Garbled,
    /// The controller reports an error.
    ControllerError(ControllerError),
}

/// An error that a CAN controller reports.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum ControllerError {
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
    /// The frame could not be handed over before the transmit queue's timeout ended, or the bus is gone.
    fn send(&mut self, frame: &Frame) -> io::Result<()>;

    /// The next thing that arrives, or `None` when the deadline passes first.
    ///
    /// # Errors
    /// The adapter, server or interface is gone.
    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>>;
}
