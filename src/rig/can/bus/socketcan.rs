//! Linux SocketCAN: a raw socket with error frames switched on and the kernel's time of arrival.

use std::io;
use std::os::fd::AsFd;
use std::time::{Duration, Instant, SystemTime};

use socketcan::{CanSocket, EmbeddedFrame, Frame as _, Socket, SocketOptions, StandardId};

use super::arrival::ArrivalClock;
use super::can_bus::{Arrival, CanBus, ControllerError, Received};
use super::frame::Frame;
use super::netlink;
use super::readiness::{readable, writable};
use super::spec::BitRate;

/// A raw CAN socket.
#[derive(Debug)]
pub struct SocketCan {
    socket: CanSocket,
    arrivals: ArrivalClock,
    /// How long the interface's transmit queue may be full.
    send_timeout: Duration,
}

impl SocketCan {
    /// Opens a socket on the interface. `send_timeout` is how long a frame may wait for the transmit queue.
    ///
    /// # Errors
    /// What the operating system said, or an interface with another bit rate.
    pub fn open(interface: &str, bit_rate: BitRate, send_timeout: Duration) -> io::Result<Self> {
        if let Some(error) = wrong_bit_rate(interface, netlink::bit_rate(interface)?, bit_rate) {
            return Err(error);
        }
        let socket = CanSocket::open(interface)?;
        socket.set_error_filter_accept_all()?;
        socket.set_recv_timestamp(true)?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, arrivals: ArrivalClock::new(Instant::now(), SystemTime::now()), send_timeout })
    }
}

/// Why the interface's bit rate is refused; a virtual interface (vcan) has none.
fn wrong_bit_rate(interface: &str, found: Option<u32>, expected: BitRate) -> Option<io::Error> {
    let (found, expected) = (found?, expected.bits_per_s());
    (found != expected).then(|| {
        io::Error::new(
            io::ErrorKind::InvalidInput,
            format!(
                "its bit rate is {found} bit/s, and bit_rate is {expected}; set it with: ip link set {interface} down, \
                 then ip link set {interface} up type can bitrate {expected}; or correct bit_rate"
            ),
        )
    })
}

impl CanBus for SocketCan {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let id = StandardId::new(frame.id).ok_or(io::ErrorKind::InvalidInput)?;
        let frame = socketcan::CanFrame::new(id, frame.data()).ok_or(io::ErrorKind::InvalidInput)?;
        let deadline = Instant::now() + self.send_timeout;
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
                Ok((frame, stamp)) => {
                    let arrived = self.arrivals.arrival(stamp, Instant::now(), SystemTime::now());
                    return Ok(Some(received(&frame, arrived)));
                }
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    self.arrivals.drained(Instant::now());
                    if !readable(self.socket.as_fd(), deadline)? {
                        return Ok(None);
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }
}

fn received(frame: &socketcan::CanFrame, arrived: Instant) -> Received {
    match frame {
        socketcan::CanFrame::Data(data) if data.is_standard() => {
            Received::Frame(Frame::new(data.raw_id() as u16, data.data()), Arrival::at(arrived))
        }
        socketcan::CanFrame::Error(error) => {
            Received::ControllerError(controller_error(error.raw_id(), error.data()))
        }
        _ => Received::Foreign,
    }
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

    #[test]
    fn an_interface_with_another_bit_rate_is_refused_and_one_without_any_is_not() {
        let megabit = BitRate::MAX;
        let error = wrong_bit_rate("can0", Some(500_000), megabit).unwrap().to_string();
        assert!(
            error.contains("500000") && error.contains("1000000") && error.contains("ip link set can0"),
            "{error}"
        );
        assert!(wrong_bit_rate("can0", Some(1_000_000), megabit).is_none());
        assert!(wrong_bit_rate("vcan0", None, megabit).is_none());
    }
}
