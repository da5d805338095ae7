//! Waiting for a file descriptor until a point in time, without asking for memory.

use std::io;
use std::os::fd::BorrowedFd;
use std::time::Instant;

use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

/// Whether there is something to read before `deadline`.
pub fn readable(fd: BorrowedFd<'_>, deadline: Instant) -> io::Result<bool> {
    ready(fd, PollFlags::IN, deadline)
}

/// Whether something can be written before `deadline`.
pub fn writable(fd: BorrowedFd<'_>, deadline: Instant) -> io::Result<bool> {
    ready(fd, PollFlags::OUT, deadline)
}

fn ready(fd: BorrowedFd<'_>, wanted: PollFlags, deadline: Instant) -> io::Result<bool> {
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        let timeout = Timespec { tv_sec: left.as_secs() as i64, tv_nsec: i64::from(left.subsec_nanos()) };
        let mut set = [PollFd::from_borrowed_fd(fd, wanted)];
        match poll(&mut set, Some(&timeout)) {
            Ok(0) => return Ok(false),
            Ok(_) if set[0].revents().contains(wanted) => return Ok(true),
            Ok(_) => return Err(io::ErrorKind::BrokenPipe.into()),
            Err(Errno::INTR) => {}
            Err(error) => return Err(error.into()),
        }
    }
}
