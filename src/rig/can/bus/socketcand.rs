//! socketcand's ASCII protocol over TCP, raw mode: a bus on another machine, or one that several programs share.

use std::io::{self, Read, Write};
use std::net::{SocketAddr, TcpStream, ToSocketAddrs};
#[cfg(unix)]
use std::os::fd::AsFd;
use std::sync::mpsc;
use std::time::{Duration, Instant};

use super::arrival::ReadClock;
use super::can_bus::{Arrival, CanBus, ControllerError, Received};
use super::frame::Frame;

const SERVER_TIMEOUT: Duration = Duration::from_secs(2);
const SERVER_BUFFER_BYTES: usize = 8192;
/// Reads after a deadline: what had arrived by then is taken in, and a server that is never silent holds nobody up.
const READS_AFTER_DEADLINE: usize = 4;

/// A connection in raw mode.
#[derive(Debug)]
pub struct Socketcand {
    stream: TcpStream,
    buffer: Box<[u8; SERVER_BUFFER_BYTES]>,
    /// What of the buffer is filled and not yet taken apart.
    from: usize,
    to: usize,
    /// When what was read last arrived.
    arrival: Arrival,
    reads: ReadClock,
    /// How long the server may refuse to take a frame.
    send_timeout: Duration,
}

impl Socketcand {
    /// Connects, opens the bus and goes to raw mode. `send_timeout` is how long a frame may wait for the server.
    ///
    /// # Errors
    /// No server at this address, or one that says something else than socketcand or nothing, within seconds.
    pub fn open(host: &str, port: u16, channel: &str, send_timeout: Duration) -> io::Result<Self> {
        let stream = connect(host, port)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(SERVER_TIMEOUT))?;
        let buffer = Box::new([0; SERVER_BUFFER_BYTES]);
        let now = Instant::now();
        let mut server = Self {
            stream,
            buffer,
            from: 0,
            to: 0,
            arrival: Arrival::at(now),
            reads: ReadClock::new(now),
            send_timeout,
        };
        server.expect("hi", "a greeting")?;
        for command in [format!("< open {channel} >"), "< rawmode >".to_owned()] {
            server.stream.write_all(command.as_bytes())?;
            server.expect("ok", &command)?;
        }
        server.stream.set_write_timeout(Some(server.send_timeout.max(Duration::from_micros(100))))?;
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
            // Bytes that are no command must not hold it up either.
            if Instant::now() >= deadline || !self.fill(deadline)? {
                return Err(io::Error::new(
                    io::ErrorKind::TimedOut,
                    format!(
                        "the server did not answer ({to_what}) within {SERVER_TIMEOUT:?}; is it socketcand?"
                    ),
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
        let asked = Instant::now();
        if !self.wait(deadline)? {
            self.reads.drained(asked);
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
        let asked = Instant::now();
        let count = self.stream.read(&mut self.buffer[self.to..])?;
        if count == 0 {
            return Err(io::ErrorKind::ConnectionReset.into());
        }
        self.to += count;
        self.arrival = self.reads.read(asked, self.to < SERVER_BUFFER_BYTES);
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
        let bytes = &text[..text.len() - left];
        let deadline = Instant::now() + self.send_timeout;
        let mut written = 0;
        while written < bytes.len() {
            let full = |error: &io::Error| {
                matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut)
            };
            match self.stream.write(&bytes[written..]) {
                Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                Ok(count) => written += count,
                Err(error) if error.kind() == io::ErrorKind::Interrupted && Instant::now() < deadline => {}
                Err(error) if full(&error) => {
                    let message = "the server takes no frames; is its bus, or the network, overloaded?";
                    return Err(io::Error::new(io::ErrorKind::TimedOut, message));
                }
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    fn receive(&mut self, deadline: Instant) -> io::Result<Option<Received>> {
        let mut reads_after_deadline = 0;
        loop {
            if let Some((from, to)) = self.command() {
                return Ok(Some(parse(&self.buffer[from..to], self.arrival)));
            }
            if reads_after_deadline >= READS_AFTER_DEADLINE || !self.fill(deadline)? {
                return Ok(None);
            }
            reads_after_deadline += usize::from(Instant::now() >= deadline);
        }
    }
}

/// A connection to the first address of the host that takes one. Neither the name service nor the network is waited for
/// longer than [`SERVER_TIMEOUT`].
fn connect(host: &str, port: u16) -> io::Result<TcpStream> {
    let mut outcome = Err(io::Error::new(io::ErrorKind::NotFound, format!("{host} has no address")));
    let deadline = Instant::now() + SERVER_TIMEOUT;
    for address in addresses(host, port)? {
        let left = deadline.saturating_duration_since(Instant::now()).max(Duration::from_millis(1));
        outcome = TcpStream::connect_timeout(&address, left);
        if outcome.is_ok() {
            break;
        }
    }
    outcome
}

/// The addresses of a host. The name service has no time limit of its own, so it is asked on another thread.
fn addresses(host: &str, port: u16) -> io::Result<Vec<SocketAddr>> {
    let (tell, told) = mpsc::channel();
    let name = host.to_owned();
    std::thread::spawn(move || {
        let found = (name.as_str(), port).to_socket_addrs().map(Iterator::collect);
        // Nobody waits any more when it took too long.
        let _ = tell.send(found);
    });
    told.recv_timeout(SERVER_TIMEOUT).unwrap_or_else(|_| {
        let message = format!("the name service does not say where {host} is; write its address as a number");
        Err(io::Error::new(io::ErrorKind::TimedOut, message))
    })
}

/// `frame ID SECONDS.MICROSECONDS DATA`, `error CLASS SECONDS DATA`, or what concerns us not.
fn parse(text: &[u8], arrival: Arrival) -> Received {
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
            frame().map_or(Received::Garbled, |frame| Received::Frame(frame, arrival))
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
        let now = Arrival::at(Instant::now());
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

    /// A server that treats its one guest as `behave` does.
    fn server(behave: impl FnOnce(TcpStream) + Send + 'static) -> u16 {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        std::thread::spawn(move || behave(listener.accept().unwrap().0));
        port
    }

    fn open_within(port: u16, most: Duration) -> io::Result<Socketcand> {
        let began = Instant::now();
        let opened = Socketcand::open("127.0.0.1", port, "can0", Duration::from_millis(5));
        assert!(began.elapsed() < most, "opening took {:?}", began.elapsed());
        opened
    }

    fn greet(guest: &mut TcpStream) {
        guest.write_all(b"< hi >").unwrap();
        for _ in 0..2 {
            let _ = guest.read(&mut [0; 64]).unwrap();
            guest.write_all(b"< ok >").unwrap();
        }
    }

    #[test]
    fn a_server_that_says_nothing_or_never_ends_a_word_is_refused_in_time() {
        let silent = server(|mut guest| drop(guest.read(&mut [0])));
        let error = open_within(silent, Duration::from_secs(4)).unwrap_err();
        assert!(error.to_string().contains("did not answer"), "{error}");
        let endless = server(|mut guest| while guest.write_all(&[b'x'; 64]).is_ok() {});
        let error = open_within(endless, Duration::from_secs(4)).unwrap_err();
        assert!(error.to_string().contains("did not answer"), "{error}");
    }

    #[test]
    fn a_server_that_takes_no_frames_fails_one_after_the_time_that_a_frame_may_wait() {
        let (done, wait) = mpsc::channel::<()>();
        let port = server(move |mut guest| {
            greet(&mut guest);
            let _ = wait.recv();
        });
        let mut bus = open_within(port, Duration::from_secs(4)).unwrap();
        let frame = Frame::new(0x123, &[0xAA; 8]);
        let (error, took) = (0..1_000_000)
            .find_map(|_| {
                let began = Instant::now();
                bus.send(&frame).err().map(|error| (error, began.elapsed()))
            })
            .expect("a connection that nobody reads is full at some time");
        assert_eq!(error.kind(), io::ErrorKind::TimedOut);
        assert!(took < Duration::from_millis(500), "{took:?}");
        drop(done);
    }

    #[test]
    fn a_server_that_sends_no_whole_word_does_not_hold_a_deadline_up() {
        let port = server(|mut guest| {
            greet(&mut guest);
            while guest.write_all(&[b'x'; 64]).is_ok() {}
        });
        let mut bus = open_within(port, Duration::from_secs(4)).unwrap();
        let began = Instant::now();
        assert_eq!(bus.receive(began + Duration::from_millis(20)).unwrap(), None);
        assert!(began.elapsed() < Duration::from_millis(500), "{:?}", began.elapsed());
    }
}
