//! Where words go: results to standard output, messages to standard error.

use std::fmt::Display;
use std::io::{self, StdoutLock, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tracing::Level;

/// The two streams of the terminal, as loud as the user asked for.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    quiet: bool,
}

impl Console {
    /// Sets the loudness for the whole program: `--quiet`, nothing, `-v` or `-vv`.
    pub fn new(quiet: bool, verbose: u8) -> Self {
        let level = match (quiet, verbose) {
            (true, _) => Level::ERROR,
            (false, 0) => Level::WARN,
            (false, 1) => Level::INFO,
            (false, _) => Level::DEBUG,
        };
        tracing_subscriber::fmt()
            .with_max_level(level)
            .with_writer(io::stderr)
            .without_time()
            .with_target(false)
            .with_ansi(false)
            .init();
        Self { quiet }
    }

    /// The same without messages, for work on many sessions at once.
    pub fn silent(&self) -> Self {
        Self { quiet: true }
    }

    /// Standard output. A reader that went away ends the program in silence, see [`super::Failure`].
    pub fn results(&self) -> StdoutLock<'static> {
        io::stdout().lock()
    }

    /// A line for the person at the terminal; not with `--quiet`.
    pub fn message(&self, message: impl Display) {
        if !self.quiet {
            to_stderr(&message);
        }
    }

    /// A bar with the time left on standard error; hidden with `--quiet` and where that is no terminal.
    pub fn progress(&self, length: u64, what: &'static str) -> ProgressBar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(length), target).with_message(what);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta} left") {
            bar.set_style(style);
        }
        bar
    }

    /// A line without which the program is of no use; always said.
    pub fn announce(&self, message: impl Display) {
        to_stderr(&message);
    }

    /// Why the program ends without having done its work; always said.
    pub fn error(&self, error: impl Display) {
        to_stderr(&format_args!("error: {error}"));
    }

    /// A sign of life with the time that has passed, for work whose length is not known; hidden as [`Console::progress`] is.
    pub fn stages(&self) -> ProgressBar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        bar
    }

    /// Whether the user asked for silence; progress bars respect it.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }
}

/// Nobody may be listening on standard error either, and then there is no one left to tell.
fn to_stderr(message: &dyn Display) {
    let _ = writeln!(io::stderr().lock(), "{message}");
}
