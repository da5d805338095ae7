//! socketcand's ASCII protocol over TCP, raw mode: a bus on another machine, or one that several programs share.

use std::io::{self, Read, Write};
use std::net::TcpStream;
#[cfg(unix)]
use std::os::fd::AsFd;
use std::time::{Duration, Instant};

use super::can_bus::{CanBus, ControllerError, Received};
use super::frame::Frame;

const SERVER_TIMEOUT: Duration = Duration::from_secs(2);
const SERVER_BUFFER_BYTES: usize = 8192;

/// A connection in raw mode.
#[derive(Debug)]
pub struct Socketcand {
    stream: TcpStream,
    buffer: Box<[u8; SERVER_BUFFER_BYTES]>,
    /// What of the buffer is filled and not yet taken apart.
    from: usize,
    to: usize,
}

impl Socketcand {
    /// Connects, opens the bus and goes to raw mode.
    pub fn open(host: &str, port: u16, channel: &str) -> io::Result<Self> {
        let stream = TcpStream::connect((host, port))?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(SERVER_TIMEOUT))?;
        let mut server = Self { stream, buffer: Box::new([0; SERVER_BUFFER_BYTES]), from: 0, to: 0 };
        server.expect("hi", "a greeting")?;
        for command in [format!("< open {channel} >"), "< rawmode >".to_owned()] {
            server.stream.write_all(command.as_bytes())?;
            server.expect("ok", &command)?;
        }
        Ok(server)
    }

    fn expect(&mut self, word: &str, to_what: &str) -> io::Result<()> {
        let deadline = Instant::now() + SERVER_TIMEOUT;
        loop {
            if let Some((from, to)) = self.command() {
                let text = String::from_utf8_lossy(&self.buffer[from..to]).trim().to_owned();
                if text == word {
                    return Ok(());
                }
                return Err(io::Error::other(format!("the server answers {to_what} with {text:?}")));
            }
            if !self.fill(deadline)? {
                return Err(io::Error::new(
                    io::ErrorKind::TimedOut,
                    "the server says nothing; is it socketcand?",
                ));
            }
        }
    }

    #[cfg(unix)]
    fn wait(&self, deadline: Instant) -> io::Result<bool> {
        super::readiness::readable(self.stream.as_fd(), deadline)
    }

    #[cfg(not(unix))]
    fn wait(&self, deadline: Instant) -> io::Result<bool> {
        let left = deadline.saturating_duration_since(Instant::now()).max(Duration::from_micros(100));
        self.stream.set_read_timeout(Some(left))?;
        match self.stream.peek(&mut [0]) {
            Ok(_) => Ok(true),
            Err(error) if matches!(error.kind(), io::ErrorKind::TimedOut | io::ErrorKind::WouldBlock) => {
                Ok(false)
            }
            Err(error) => Err(error),
        }
    }

    fn fill(&mut self, deadline: Instant) -> io::Result<bool> {
        if !self.wait(deadline)? {
            return Ok(false);
        }
        if self.from > 0 {
            self.buffer.copy_within(self.from..self.to, 0);
            self.to -= self.from;
            self.from = 0;
        }
        if self.to == SERVER_BUFFER_BYTES {
            // Nothing the server says is that long: it is not socketcand, or bytes were lost.
            self.to = 0;
        }
        let count = self.stream.read(&mut self.buffer[self.to..])?;
        if count == 0 {
            return Err(io::ErrorKind::ConnectionReset.into());
        }
        self.to += count;
        Ok(true)
    }

    /// Where between `<` and `>` the next command stands.
    fn command(&mut self) -> Option<(usize, usize)> {
        let text = &self.buffer[self.from..self.to];
        let close = text.iter().position(|byte| *byte == b'>')?;
        let open = text[..close].iter().rposition(|byte| *byte == b'<').map_or(0, |at| at + 1);
        let found = (self.from + open, self.from + close);
        self.from += close + 1;
        Some(found)
    }
}

impl CanBus for Socketcand {
    fn send(&mut self, frame: &Frame) -> io::Result<()> {
        let mut text = [0u8; 64];
        let mut rest = &mut text[..];
        write!(rest, "< send {:X} {:X} ", frame.id, frame.data().len())?;
        for byte in frame.data() {
            write!(rest, "{byte:02X} ")?;
        }
        write!(rest, ">")?;
        let left = rest.len();
        self.stream.write_all(&text[..text.len() - left])
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        loop {
            if let Some((from, to)) = self.command() {
                return Ok(Some(parse(&self.buffer[from..to], Instant::now())));
            }
            if !self.fill(deadline)? {
                return Ok(None);
            }
        }
    }
}

/// `frame ID SECONDS.MICROSECONDS DATA`, `error CLASS SECONDS DATA`, or what concerns us not.
fn parse(text: &[u8], now: Instant) -> Received {
    let Ok(text) = std::str::from_utf8(text) else { return Received::Garbled };
    let mut words = text.split_ascii_whitespace();
    match (words.next(), words.next()) {
        (Some("frame"), Some(id)) if id.len() == 3 => {
            let frame = || {
                words.next()?;
                let id = u16::from_str_radix(id, 16).ok().filter(|id| *id <= 0x7FF)?;
                let (mut bytes, mut length) = ([0u8; 8], 0);
                for pair in words.flat_map(|word| word.as_bytes().chunks(2)) {
                    *bytes.get_mut(length)? = u8::from_str_radix(std::str::from_utf8(pair).ok()?, 16).ok()?;
                    length += 1;
                }
                Some(Frame::new(id, &bytes[..length]))
            };
            frame().map_or(Received::Garbled, |frame| Received::Frame(frame, now))
        }
        (Some("frame" | "rtr"), Some(_)) => Received::Foreign,
        (Some("error"), Some(class)) => Received::ControllerError(controller_error(class)),
        (Some("echo" | "ok"), _) => Received::Foreign,
        _ => Received::Garbled,
    }
}

/// The class of Linux' error frames, linux/can/error.h.
fn controller_error(class: &str) -> ControllerError {
    match u32::from_str_radix(class, 16) {
        Ok(class) if class & 0x40 != 0 => ControllerError::BusOff,
        Ok(class) if class & 0x100 != 0 => ControllerError::Restarted,
        Ok(class) if class & 0x04 != 0 => ControllerError::Passive,
        _ => ControllerError::BusError,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_server_says_is_told_apart() {
        let now = Instant::now();
        let frame = |text: &str| parse(text.as_bytes(), now);
        assert_eq!(frame(" frame 123 1.000002 01F1 "), Received::Frame(Frame::new(0x123, &[1, 0xF1]), now));
        assert_eq!(frame(" frame 080 1.0 "), Received::Frame(Frame::new(0x80, &[]), now));
        assert_eq!(
            frame("frame 123 1.0 11 22 33"),
            Received::Frame(Frame::new(0x123, &[0x11, 0x22, 0x33]), now)
        );
        assert_eq!(frame("frame 00000123 1.0 11"), Received::Foreign);
        assert_eq!(frame("rtr 123 1.0 4"), Received::Foreign);
        assert_eq!(frame("error 00000040 1.0"), Received::ControllerError(ControllerError::BusOff));
        for garbled in [
            "",
            "frame",
            "frame 9FF 1.0 11",
            "frame 123 1.0 1G",
            "frame 123 1.0 112233445566778899",
            "hello you",
        ] {
            assert_eq!(frame(garbled), Received::Garbled, "{garbled}");
        }
    }
}
