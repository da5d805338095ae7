//! Output of the program: results to standard output, messages to standard error.

use std::fmt::Display;
use std::io::{self, StdoutLock, Write};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use tracing::Level;

use super::safe_output::SafeOutput;

/// Longest message: longer than any list of problems that a person reads.
const LONGEST_MESSAGE_BYTES: usize = 64 << 10;

/// The standard streams, with the verbosity that the user chose.
#[derive(Debug, Clone, Copy)]
pub struct Console {
    quiet: bool,
}

impl Console {
    /// Sets the verbosity of the whole program: `--quiet`, default, `-v` or `-vv`.
    pub fn new(quiet: bool, verbose: u8) -> Self {
        let level = match (quiet, verbose) {
            (true, _) => Level::ERROR,
            (false, 0) => Level::WARN,
            (false, 1) => Level::INFO,
            (false, _) => Level::DEBUG,
        };
        tracing_subscriber::fmt()
            .with_max_level(level)
            .with_writer(|| SafeOutput(io::stderr()))
            .without_time()
            .with_target(false)
            .with_ansi(false)
            // They would be told by a macro that panics when the terminal is gone.
            .log_internal_errors(false)
            .init();
        Self { quiet }
    }

    /// A copy that prints no messages, for work on many sessions at once.
    pub fn silent(&self) -> Self {
        Self { quiet: true }
    }

    /// Standard output, on which control characters from files are written as numbers. A reader that went away ends the
    /// program in silence, see [`super::failure::Failure`].
    pub fn results(&self) -> SafeOutput<StdoutLock<'static>> {
        SafeOutput(io::stdout().lock())
    }

    /// Prints a line on standard error, except with `--quiet`.
    pub fn message(&self, message: impl Display) {
        if !self.quiet {
            to_stderr(&message);
        }
    }

    /// A progress bar with the time left on standard error; hidden with `--quiet` and where that is not a terminal.
    pub fn progress(&self, length: u64, what: &'static str) -> ProgressBar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(Some(length), target).with_message(what);
        if let Ok(style) = ProgressStyle::with_template("{msg} {wide_bar} {pos}/{len} {eta} left") {
            bar.set_style(style);
        }
        bar
    }

    /// Prints a line that the user needs, also with `--quiet`.
    pub fn announce(&self, message: impl Display) {
        to_stderr(&message);
    }

    /// Prints an error, also with `--quiet`.
    pub fn error(&self, error: impl Display) {
        to_stderr(&format_args!("error: {error}"));
    }

    /// A spinner with the elapsed time, for work of unknown length; hidden like [`Console::progress`].
    pub fn stages(&self) -> ProgressBar {
        let target = if self.quiet { ProgressDrawTarget::hidden() } else { ProgressDrawTarget::stderr() };
        let bar = ProgressBar::with_draw_target(None, target);
        if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed} {msg}") {
            bar.set_style(style);
        }
        bar.enable_steady_tick(Duration::from_millis(100));
        bar
    }

    /// Whether `--quiet` was given; progress bars are then hidden.
    pub fn is_quiet(&self) -> bool {
        self.quiet
    }
}

/// Prints on standard error; an error there is ignored, because there is no other place to report it.
fn to_stderr(message: &dyn Display) {
    let mut text = message.to_string();
    if text.len() > LONGEST_MESSAGE_BYTES {
        let end = text.floor_char_boundary(LONGEST_MESSAGE_BYTES);
        text.replace_range(end.., " ... (the rest is left out)");
    }
    let _ = writeln!(SafeOutput(io::stderr().lock()), "{text}");
}
