//! Lawicel's ASCII protocol (SLCAN) on a serial device: what the cheapest USB adapters speak, on any system.
//!
//! A frame is `tIIIL` and two hexadecimal digits a byte, closed by a carriage return. `z` acknowledges one of ours,
//! BEL refuses a command.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
#[cfg(unix)]
use std::os::fd::{AsRawFd, BorrowedFd};
use std::time::{Duration, Instant};

use super::can_bus::{CanBus, ControllerError, Received};
use super::frame::Frame;
use super::spec::BitRate;

/// USB adapters ignore it; those with a real serial line behind them run at it.
const BAUD: u32 = 2_000_000;
const ADAPTER_REPLY_TIMEOUT: Duration = Duration::from_millis(300);
/// How long the adapter may refuse to take bytes.
const SERIAL_WRITE_TIMEOUT: Duration = Duration::from_millis(50);
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
}

impl Slcan {
    /// Opens the device and its channel.
    pub fn open(device: &str, bit_rate: BitRate) -> io::Result<Self> {
        let port = serialport::new(device, BAUD).timeout(SERIAL_WRITE_TIMEOUT).open_native()?;
        let mut adapter = Self {
            port,
            line: Vec::with_capacity(64),
            read: vec![0; SERIAL_BUFFER_BYTES],
            waiting: VecDeque::with_capacity(SERIAL_BUFFER_BYTES),
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
        while self.fill(Instant::now() + Duration::from_millis(50))? {}
        self.waiting.clear();
        self.line.clear();
        Ok(())
    }

    /// A command and its answer. Some adapters answer nothing at all; only a BEL is a refusal.
    fn command(&mut self, command: &[u8], what: &str) -> io::Result<()> {
        self.write(command)?;
        let deadline = Instant::now() + ADAPTER_REPLY_TIMEOUT;
        if self.fill(deadline)?
            && self.waiting.iter().any(|one| *one == Received::ControllerError(ControllerError::BusError))
        {
            let message = format!("the adapter refuses {what}; is it a SLCAN (Lawicel) adapter?");
            return Err(io::Error::other(message));
        }
        self.waiting.clear();
        Ok(())
    }

    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        #[cfg(unix)]
        if !super::readiness::writable(self.fd(), Instant::now() + SERIAL_WRITE_TIMEOUT)? {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.port.write_all(bytes)
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
        if !self.wait(deadline)? {
            return Ok(false);
        }
        let count = self.port.read(&mut self.read)?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        let now = Instant::now();
        for at in 0..count {
            self.take(self.read[at], now);
        }
        Ok(true)
    }

    fn take(&mut self, byte: u8, now: Instant) {
        match byte {
            b'\r' => {
                if let Some(received) = line(&self.line, now) {
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
        self.write(&text[..length])
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        loop {
            if let Some(received) = self.waiting.pop_front() {
                return Ok(Some(received));
            }
            if !self.fill(deadline)? {
                return Ok(None);
            }
        }
    }
}

impl Drop for Slcan {
    fn drop(&mut self) {
        // The adapter forgets a channel that is left open; closing it is a courtesy to the next program.
        let _ = self.port.write_all(b"C\r");
    }
}

impl std::fmt::Debug for Slcan {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        formatter.debug_struct("Slcan").finish_non_exhaustive()
    }
}

const HEX: &[u8; 16] = b"0123456789ABCDEF";

/// Writes a frame as Lawicel's ASCII; its length.
fn encode(frame: &Frame, text: &mut [u8; 32]) -> usize {
    let digit = |value: u16| HEX[usize::from(value & 0xF)];
    text[..5].copy_from_slice(&[
        b't',
        digit(frame.id >> 8),
        digit(frame.id >> 4),
        digit(frame.id),
        digit(frame.data().len() as u16),
    ]);
    let mut at = 5;
    for byte in frame.data() {
        text[at] = digit(u16::from(*byte) >> 4);
        text[at + 1] = digit(u16::from(*byte));
        at += 2;
    }
    text[at] = b'\r';
    at + 1
}

/// What a line says; nothing for acknowledgements and answers.
fn line(line: &[u8], now: Instant) -> Option<Received> {
    let line = match line {
        [b'z' | b'Z', rest @ ..] => rest,
        whole => whole,
    };
    match line.first() {
        None | Some(b'V' | b'N') => None,
        Some(b'F') => flags(&line[1..]),
        Some(b'T' | b'r' | b'R') => Some(Received::Foreign),
        Some(b't') => Some(decode(&line[1..]).map_or(Received::Garbled, |frame| Received::Frame(frame, now))),
        Some(_) => Some(Received::Garbled),
    }
}

/// The answer to `F`: bit 2 warning, 3 overrun, 5 passive, 7 bus error.
fn flags(digits: &[u8]) -> Option<Received> {
    let [high, low] = digits else { return Some(Received::Garbled) };
    let flags = nibble(*high)? << 4 | nibble(*low)?;
    let trouble = match flags {
        0 => return None,
        _ if flags & 0x80 != 0 => ControllerError::BusError,
        _ if flags & 0x20 != 0 => ControllerError::Passive,
        _ if flags & 0x08 != 0 => ControllerError::Overrun,
        _ => ControllerError::Warning,
    };
    Some(Received::ControllerError(trouble))
}

fn nibble(digit: u8) -> Option<u8> {
    char::from(digit).to_digit(16).map(|value| value as u8)
}

fn decode(text: &[u8]) -> Option<Frame> {
    let (head, data) = text.split_at_checked(4)?;
    let mut id = 0u16;
    for digit in &head[..3] {
        id = id << 4 | u16::from(nibble(*digit)?);
    }
    let length = usize::from(nibble(head[3])?);
    // Adapters with time stamps switched on add four digits.
    if id > 0x7FF || length > 8 || !(data.len() == 2 * length || data.len() == 2 * length + 4) {
        return None;
    }
    let mut bytes = [0u8; 8];
    for (byte, pair) in bytes.iter_mut().zip(data[..2 * length].chunks_exact(2)) {
        *byte = nibble(pair[0])? << 4 | nibble(pair[1])?;
    }
    Some(Frame::new(id, &bytes[..length]))
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn heard(text: &[u8]) -> Option<Received> {
        line(text, Instant::now())
    }

    #[test]
    fn lines_that_are_frames_answers_or_neither_are_told_apart() {
        assert!(
            matches!(heard(b"t1232AABB"), Some(Received::Frame(f, _)) if f == Frame::new(0x123, &[0xAA, 0xBB]))
        );
        assert!(matches!(heard(b"zt0800"), Some(Received::Frame(f, _)) if f == Frame::new(0x80, &[])));
        assert!(matches!(heard(b"t1231AA1234"), Some(Received::Frame(..))), "a time stamp behind it");
        for answer in [b"".as_slice(), b"z", b"Z", b"V1013", b"NCB01", b"F00"] {
            assert_eq!(heard(answer), None);
        }
        for garbled in [b"t12".as_slice(), b"t12?2AABB", b"t1232AAB", b"t9991AA", b"t1239", b"x"] {
            assert_eq!(heard(garbled), Some(Received::Garbled), "{}", String::from_utf8_lossy(garbled));
        }
        assert_eq!(heard(b"T000001230"), Some(Received::Foreign));
        assert_eq!(heard(b"F80"), Some(Received::ControllerError(ControllerError::BusError)));
        assert_eq!(heard(b"F04"), Some(Received::ControllerError(ControllerError::Warning)));
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn every_frame_survives_the_way_through_ascii(id in 0u16..0x800, data in prop::collection::vec(any::<u8>(), 0..=8)) {
            let frame = Frame::new(id, &data);
            let mut text = [0; 32];
            let length = encode(&frame, &mut text);
            prop_assert_eq!(text[length - 1], b'\r');
            prop_assert_eq!(decode(&text[1..length - 1]), Some(frame));
        }

        #[test]
        fn no_line_makes_the_reader_stumble(text in prop::collection::vec(any::<u8>(), 0..40)) {
            let _ = heard(&text);
        }
    }
}
