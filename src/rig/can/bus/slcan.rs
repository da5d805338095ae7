//! Lawicel's ASCII protocol (SLCAN) on a serial device: what the cheapest USB adapters speak, on any system.
//!
//! BEL refuses a command; the [lines](super::slcan_line) say the rest.

use std::collections::VecDeque;
#[cfg(windows)]
use std::io::Write;
use std::io::{self, Read};
#[cfg(unix)]
use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::{Duration, Instant};

use super::arrival::ReadClock;
use super::can_bus::{Arrival, CanBus, ControllerError, Received};
use super::frame::Frame;
use super::slcan_line::{encode, received};
use super::spec::BitRate;

/// USB adapters ignore it; those with a real serial line behind them run at it.
const BAUD: u32 = 2_000_000;
const ADAPTER_REPLY_TIMEOUT: Duration = Duration::from_millis(300);
/// Silence after which an adapter has nothing more to say.
const ADAPTER_SILENCE: Duration = Duration::from_millis(50);
/// How long an adapter may go on sending after its channel was closed.
const ADAPTER_SETTLE_TIMEOUT: Duration = Duration::from_millis(500);
/// How long the adapter may refuse to take bytes while it is opened or closed.
const SERIAL_WRITE_TIMEOUT: Duration = Duration::from_millis(50);
/// Reads after a deadline: what had arrived by then is taken in, and an adapter that is never silent holds nobody up.
const READS_AFTER_DEADLINE: usize = 4;
/// Room for what came in one read, and a line that is not complete yet.
const SERIAL_BUFFER_BYTES: usize = 4096;

#[cfg(unix)]
type Port = serialport::TTYPort;
#[cfg(windows)]
type Port = serialport::COMPort;

/// A serial adapter with its channel open.
pub struct Slcan {
    port: Port,
    /// The line that is arriving.
    line: Vec<u8>,
    read: Vec<u8>,
    waiting: VecDeque<Received>,
    reads: ReadClock,
    /// Lines without content: the adapter's acknowledgements of commands.
    acknowledgements: u64,
    /// How long the adapter may refuse to take a frame.
    send_timeout: Duration,
}

impl Slcan {
    /// Opens the device and its channel. `send_timeout` is how long a frame may wait for the adapter.
    ///
    /// # Errors
    /// What the operating system said; an adapter that does not fall silent, refuses a command, or takes no bytes.
    pub fn open(device: &str, bit_rate: BitRate, send_timeout: Duration) -> io::Result<Self> {
        let port = serialport::new(device, BAUD).timeout(SERIAL_WRITE_TIMEOUT).open_native()?;
        // A blocking write would wait for as long as the adapter takes no bytes.
        #[cfg(unix)]
        set_nonblocking(&port)?;
        let mut adapter = Self {
            port,
            line: Vec::with_capacity(64),
            read: vec![0; SERIAL_BUFFER_BYTES],
            waiting: VecDeque::with_capacity(SERIAL_BUFFER_BYTES),
            reads: ReadClock::new(Instant::now()),
            acknowledgements: 0,
            send_timeout,
        };
        // Whatever was begun before, then a closed channel: an adapter that was left open refuses the bit rate.
        adapter.write(b"\r\r\rC\r")?;
        adapter.settle()?;
        adapter.command(&[b'S', bit_rate.lawicel(), b'\r'], "the bit rate")?;
        adapter.command(b"O\r", "to open its channel")?;
        Ok(adapter)
    }

    /// Takes in what the adapter still has to say, until it has been silent for a while.
    fn settle(&mut self) -> io::Result<()> {
        let end = Instant::now() + ADAPTER_SETTLE_TIMEOUT;
        while self.fill(Instant::now() + ADAPTER_SILENCE)? {
            if Instant::now() >= end {
                let message = format!(
                    "the adapter still sends {} ms after its channel was closed (command C): it ignores the command, or \
                     it is no SLCAN (Lawicel) adapter; unplug it and plug it in again, and name the right device",
                    ADAPTER_SETTLE_TIMEOUT.as_millis()
                );
                return Err(io::Error::new(io::ErrorKind::TimedOut, message));
            }
            self.waiting.clear();
        }
        self.waiting.clear();
        self.line.clear();
        Ok(())
    }

    /// A command and its answer. Some adapters answer nothing at all; only a BEL is a refusal.
    fn command(&mut self, command: &[u8], what: &str) -> io::Result<()> {
        let before = self.acknowledgements;
        self.write(command)?;
        let deadline = Instant::now() + ADAPTER_REPLY_TIMEOUT;
        while self.acknowledgements == before && Instant::now() < deadline {
            if !self.fill(deadline)? {
                break;
            }
            if self.waiting.iter().any(|one| *one == Received::ControllerError(ControllerError::BusError)) {
                let message = format!("the adapter refuses {what}; is it a SLCAN (Lawicel) adapter?");
                return Err(io::Error::other(message));
            }
        }
        self.waiting.clear();
        Ok(())
    }

    /// Bytes to the adapter while it is opened or closed.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.write_before(bytes, Instant::now() + SERIAL_WRITE_TIMEOUT)
    }

    #[cfg(unix)]
    fn write_before(&mut self, mut bytes: &[u8], deadline: Instant) -> io::Result<()> {
        while !bytes.is_empty() {
            if !super::readiness::writable(self.fd(), deadline)? {
                return Err(no_bytes_taken());
            }
            match rustix::io::write(self.fd(), bytes) {
                Ok(count) => bytes = &bytes[count..],
                Err(rustix::io::Errno::AGAIN) if Instant::now() >= deadline => return Err(no_bytes_taken()),
                Err(rustix::io::Errno::AGAIN | rustix::io::Errno::INTR) => {}
                Err(error) => return Err(error.into()),
            }
        }
        Ok(())
    }

    /// The port's own timeout bounds each write.
    #[cfg(windows)]
    fn write_before(&mut self, bytes: &[u8], deadline: Instant) -> io::Result<()> {
        use serialport::SerialPort;
        let left = deadline.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
        self.port.set_timeout(left)?;
        self.port.write_all(bytes).map_err(|error| match error.kind() {
            io::ErrorKind::TimedOut => no_bytes_taken(),
            _ => error,
        })
    }

    #[cfg(unix)]
    fn fd(&self) -> BorrowedFd<'_> {
        // SAFETY: the descriptor belongs to `port`, which outlives the borrow.
        unsafe { BorrowedFd::borrow_raw(self.port.as_raw_fd()) }
    }

    #[cfg(unix)]
    fn wait(&mut self, deadline: Instant) -> io::Result<bool> {
        super::readiness::readable(self.fd(), deadline)
    }

    #[cfg(windows)]
    fn wait(&mut self, deadline: Instant) -> io::Result<bool> {
        use serialport::SerialPort;
        loop {
            if self.port.bytes_to_read()? > 0 {
                return Ok(true);
            }
            if Instant::now() >= deadline {
                return Ok(false);
            }
            std::thread::sleep(Duration::from_micros(200));
        }
    }

    /// Reads what is there and takes it apart; false when nothing came before the deadline.
    fn fill(&mut self, deadline: Instant) -> io::Result<bool> {
        let asked = Instant::now();
        if !self.wait(deadline)? {
            self.reads.drained(asked);
            return Ok(false);
        }
        let asked = Instant::now();
        let count = match self.port.read(&mut self.read) {
            Ok(0) => return Err(io::ErrorKind::UnexpectedEof.into()),
            Ok(count) => count,
            // Another wake-up than that of bytes.
            Err(error) if matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::Interrupted) => 0,
            Err(error) => return Err(error),
        };
        let arrival = self.reads.read(asked, count < self.read.len());
        for at in 0..count {
            self.take(self.read[at], arrival);
        }
        Ok(true)
    }

    fn take(&mut self, byte: u8, arrival: Arrival) {
        match byte {
            b'\r' => {
                self.acknowledgements += u64::from(self.line.is_empty());
                if let Some(received) = received(&self.line, arrival) {
                    self.put(received);
                }
                self.line.clear();
            }
            // BEL: the adapter could not transmit what it was given.
            0x07 => {
                self.line.clear();
                self.put(Received::ControllerError(ControllerError::BusError));
            }
            // The acknowledgement of a transmitted frame comes without a line of its own from some adapters.
            _ if self.line.len() < 63 => self.line.push(byte),
            _ => {}
        }
    }

    fn put(&mut self, received: Received) {
        if self.waiting.len() == self.waiting.capacity() {
            self.waiting.pop_front();
            self.waiting.pop_front();
            self.waiting.push_back(Received::ControllerError(ControllerError::Overrun));
        }
        self.waiting.push_back(received);
    }
}

impl CanBus for Slcan {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let mut text = [0u8; 32];
        let length = encode(frame, &mut text);
        self.write_before(&text[..length], Instant::now() + self.send_timeout)
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        let mut reads_after_deadline = 0;
        loop {
            if let Some(received) = self.waiting.pop_front() {
                return Ok(Some(received));
            }
            if reads_after_deadline >= READS_AFTER_DEADLINE || !self.fill(deadline)? {
                return Ok(None);
            }
            reads_after_deadline += usize::from(Instant::now() >= deadline);
        }
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        // The adapter forgets a channel that is left open; closing it is a courtesy to the next program.
        let _ = self.write(b"C\r");
    }
}

impl std::fmt::Debug for Slcan {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Slcan").finish_non_exhaustive()
    }
}

#[cfg(unix)]
fn set_nonblocking(port: &Port) -> io::Result<()> {
    use rustix::fs::{OFlags, fcntl_getfl, fcntl_setfl};
    // SAFETY: the descriptor belongs to `port`, which outlives the borrow.
    let fd = unsafe { BorrowedFd::borrow_raw(port.as_raw_fd()) };
    Ok(fcntl_setfl(fd, fcntl_getfl(fd)? | OFlags::NONBLOCK)?)
}

fn no_bytes_taken() -> io::Error {
    io::Error::new(io::ErrorKind::TimedOut, "the adapter takes no bytes; unplug it and plug it in again")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A serial adapter at the other end of a pseudo-terminal, driven by `behave` until it ends or the program closes.
    #[cfg(target_os = "linux")]
    fn adapter(behave: impl FnOnce(std::fs::File) + Send + 'static) -> String {
        use rustix::fs::{Mode, OFlags, open};
        use std::os::fd::AsRawFd;
        let master = open("/dev/ptmx", OFlags::RDWR | OFlags::NOCTTY, Mode::empty()).unwrap();
        let (unlocked, mut number) = (0, 0);
        // SAFETY: both calls read or write one int that lives here.
        unsafe {
            assert_eq!(libc::ioctl(master.as_raw_fd(), libc::TIOCSPTLCK, &raw const unlocked), 0);
            assert_eq!(libc::ioctl(master.as_raw_fd(), libc::TIOCGPTN, &raw mut number), 0);
        }
        std::thread::spawn(move || behave(master.into()));
        format!("/dev/pts/{number}")
    }

    #[cfg(target_os = "linux")]
    fn open_within(device: &str, most: Duration) -> io::Result<Slcan> {
        let began = Instant::now();
        let opened = Slcan::open(device, BitRate::MAX, Duration::from_millis(2));
        assert!(began.elapsed() < most, "opening took {:?}", began.elapsed());
        opened
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn an_adapter_that_ignores_the_command_to_close_and_is_never_silent_is_refused_in_time() {
        use std::io::Write as _;
        let device = adapter(|mut port| {
            while port.write_all(b"t1232AABB\r").is_ok() {
                std::thread::sleep(Duration::from_millis(1));
            }
        });
        let error = open_within(&device, Duration::from_secs(3)).unwrap_err();
        assert!(error.to_string().contains("still sends"), "{error}");
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn an_adapter_that_answers_nothing_at_all_opens_in_time() {
        use std::io::Read as _;
        let device = adapter(|mut port| while port.read(&mut [0; 256]).is_ok() {});
        open_within(&device, Duration::from_secs(2)).unwrap();
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn an_adapter_that_sends_nothing_but_acknowledgements_does_not_hold_a_deadline_up() {
        use std::io::Write as _;
        let (start, begin) = std::sync::mpsc::channel();
        let device = adapter(move |mut port| {
            begin.recv().unwrap();
            while port.write_all(&[b'\r'; 64]).is_ok() {}
        });
        let mut bus = open_within(&device, Duration::from_secs(2)).unwrap();
        start.send(()).unwrap();
        std::thread::sleep(Duration::from_millis(20));
        let began = Instant::now();
        assert_eq!(bus.receive(began + Duration::from_millis(10)).unwrap(), None);
        assert!(began.elapsed() < Duration::from_millis(500), "{:?}", began.elapsed());
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn a_frame_that_waited_arrived_between_the_read_before_and_its_own() {
        use std::io::Write as _;
        let (send, sending) = std::sync::mpsc::channel();
        let (tell, told) = std::sync::mpsc::channel();
        let device = adapter(move |mut port| {
            while sending.recv().is_ok() {
                port.write_all(b"t1232AABB\r").unwrap();
                tell.send(Instant::now()).unwrap();
            }
        });
        let mut bus = open_within(&device, Duration::from_secs(2)).unwrap();
        for _ in 0..2 {
            assert_eq!(bus.receive(Instant::now()).unwrap(), None);
            let asked = Instant::now();
            send.send(()).unwrap();
            let sent = told.recv().unwrap();
            std::thread::sleep(Duration::from_millis(20));
            let Some(Received::Frame(_, arrival)) = bus.receive(asked + Duration::from_secs(1)).unwrap()
            else {
                panic!("no frame")
            };
            assert!(arrival.earliest <= asked && sent < arrival.latest, "{asked:?} {sent:?} {arrival:?}");
        }
    }

    #[test]
    #[cfg(target_os = "linux")]
    fn an_adapter_that_takes_no_bytes_fails_a_frame_after_the_time_that_a_frame_may_wait() {
        let (done, wait) = std::sync::mpsc::channel::<()>();
        let device = adapter(move |port| {
            let _ = wait.recv();
            drop(port);
        });
        let mut bus = open_within(&device, Duration::from_secs(2)).unwrap();
        let frame = Frame::new(0x123, &[0xAA; 8]);
        let (failed, longest) = (0..20_000)
            .find_map(|_| {
                let began = Instant::now();
                bus.send(&frame).err().map(|error| (error, began.elapsed()))
            })
            .expect("a pseudo-terminal that nobody reads is full at some time");
        assert_eq!(failed.kind(), io::ErrorKind::TimedOut);
        assert!(longest < Duration::from_millis(500), "{longest:?}");
        drop(done);
    }
}
