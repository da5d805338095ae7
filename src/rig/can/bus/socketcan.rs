//! Linux SocketCAN: a raw socket with error frames switched on and the kernel's time of arrival.

use std::io;
use std::os::fd::AsFd;
use std::time::{Duration, Instant, SystemTime};

use socketcan::{CanSocket, EmbeddedFrame, Frame as _, Socket, SocketOptions, StandardId};

use super::can_bus::{CanBus, ControllerError, Received};
use super::frame::Frame;
use super::readiness::{readable, writable};

/// How long the interface's transmit queue may be full.
const QUEUE_TIMEOUT: Duration = Duration::from_millis(50);

/// A raw CAN socket.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
}

impl SocketCan {
    /// Opens a socket on the interface.
    pub fn open(interface: &str) -> io::Result<Self> {
        let socket = CanSocket::open(interface)?;
        socket.set_error_filter_accept_all()?;
        socket.set_recv_timestamp(true)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket })
    }
}

impl CanBus for SocketCan {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let id = StandardId::new(frame.id).ok_or(io::ErrorKind::InvalidInput)?;
        let frame = socketcan::CanFrame::new(id, frame.data()).ok_or(io::ErrorKind::InvalidInput)?;
        let deadline = Instant::now() + QUEUE_TIMEOUT;
        loop {
            match self.socket.write_frame(&frame) {
                Ok(()) => return Ok(()),
                // ENOBUFS: the queue of the interface is full; the socket does not tell when it no longer is.
                Err(error) if error.raw_os_error() == Some(libc::ENOBUFS) && Instant::now() < deadline => {
                    std::thread::sleep(Duration::from_micros(50));
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    if !writable(self.socket.as_fd(), deadline)? {
                        return Err(io::ErrorKind::TimedOut.into());
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        loop {
            match self.socket.read_frame_with_timestamp() {
                Ok((frame, arrived)) => return Ok(Some(received(&frame, arrived))),
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    if !readable(self.socket.as_fd(), deadline)? {
                        return Ok(None);
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }
}

fn received(frame: &socketcan::CanFrame, arrived: SystemTime) -> Received {
    match frame {
        socketcan::CanFrame::Data(data) if data.is_standard() => {
            Received::Frame(Frame::new(data.raw_id() as u16, data.data()), instant(arrived))
        }
        socketcan::CanFrame::Error(error) => {
            Received::ControllerError(controller_error(error.raw_id(), error.data()))
        }
        _ => Received::Foreign,
    }
}

/// The kernel stamps with the time of day; how long ago that was is all that matters here.
fn instant(arrived: SystemTime) -> Instant {
    let (now, wall) = (Instant::now(), SystemTime::now());
    let age = wall.duration_since(arrived).unwrap_or_default();
    now.checked_sub(age.min(Duration::from_secs(1))).unwrap_or(now)
}

/// linux/can/error.h: the class in the identifier, details of the controller in byte 1.
fn controller_error(class: u32, data: &[u8]) -> ControllerError {
    let controller = data.get(1).copied().unwrap_or(0);
    match class {
        _ if class & 0x40 != 0 => ControllerError::BusOff,
        _ if class & 0x100 != 0 => ControllerError::Restarted,
        _ if class & 0x04 != 0 && controller & 0x30 != 0 => ControllerError::Passive,
        _ if class & 0x04 != 0 && controller & 0x03 != 0 => ControllerError::Overrun,
        _ if class & 0x04 != 0 => ControllerError::Warning,
        _ => ControllerError::BusError,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn error_frames_of_the_kernel_are_put_into_words() {
        assert_eq!(controller_error(0x40, &[0; 8]), ControllerError::BusOff);
        assert_eq!(controller_error(0x04, &[0, 0x20, 0, 0, 0, 0, 0, 0]), ControllerError::Passive);
        assert_eq!(controller_error(0x04, &[0, 0x08, 0, 0, 0, 0, 0, 0]), ControllerError::Warning);
        assert_eq!(controller_error(0x04, &[0, 0x01, 0, 0, 0, 0, 0, 0]), ControllerError::Overrun);
        assert_eq!(controller_error(0x100, &[0; 8]), ControllerError::Restarted);
        assert_eq!(controller_error(0x88, &[0; 8]), ControllerError::BusError);
    }
}
