//! A question at the terminal.

use std::io::{self, BufRead, Write};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use crate::files::without_controls;

/// Time between two looks at whether the operator has stopped the program.
const ANSWER_POLL: Duration = Duration::from_millis(50);

/// Asks on standard error and waits for a line on standard input, without its line end. `None` if `stop` is set before the
/// answer, or there is no terminal any more.
pub fn ask(question: &str, stop: &AtomicBool) -> Option<String> {
    let mut stderr = io::stderr().lock();
    write!(stderr, "{}", without_controls(question)).and_then(|()| stderr.flush()).ok()?;
    drop(stderr);
    let (answers, answer) = mpsc::channel();
    // A read cannot be broken off: after a stop it waits on, and ends with the program.
    thread::spawn(move || {
        let mut line = String::new();
        let read = io::stdin().lock().read_line(&mut line);
        // Whoever asked may have gone on.
        let _ = answers.send(read.is_ok_and(|bytes| bytes > 0).then(|| line.trim().to_owned()));
    });
    while !stop.load(Ordering::Relaxed) {
        match answer.recv_timeout(ANSWER_POLL) {
            Err(mpsc::RecvTimeoutError::Timeout) => {}
            given => return given.ok().flatten(),
        }
    }
    None
}
