//! The console in a terminal, for machines without a browser.

mod draw;
mod keys;

use std::io::{self, IsTerminal};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use ratatui_core::terminal::Terminal as Screen;
use ratatui_crossterm::CrosstermBackend;
use ratatui_crossterm::crossterm::event::{self, Event as Key};
use ratatui_crossterm::crossterm::terminal::{
    EnterAlternateScreen, LeaveAlternateScreen, disable_raw_mode, enable_raw_mode,
};
use ratatui_crossterm::crossterm::{cursor, execute};

use super::controls::Controls;
use super::error::ConsoleError;
use super::thread_priority::lower_thread_priority;
use super::view_model::Views;
use super::welcome::SessionInfo;
use crate::dataset::ActionOrigin;
use keys::{KeyAction, KeyInput};

/// Time between two drawings.
const DRAW_PERIOD: Duration = Duration::from_millis(50);

/// Checks that the program can draw on a terminal: that standard error is one, and lets keys be read.
///
/// # Errors
/// If it is not, or does not.
pub fn check() -> Result<(), ConsoleError> {
    if !io::stderr().is_terminal() {
        return Err(ConsoleError::Terminal(io::Error::other("standard error is no terminal")));
    }
    enable_raw_mode().and_then(|()| disable_raw_mode()).map_err(ConsoleError::Terminal)
}

/// Draws the session in the terminal until it is dropped.
pub struct Terminal {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Terminal {
    /// Takes the terminal. `stop` is set when the operator presses Ctrl-C twice.
    ///
    /// # Errors
    /// If standard error is not a terminal that can be drawn on.
    pub fn open(
        views: Views,
        controls: Arc<dyn Controls>,
        info: SessionInfo,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, ConsoleError> {
        let screen = take().map_err(ConsoleError::Terminal)?;
        let over = Arc::new(AtomicBool::new(false));
        let ends = over.clone();
        let run = move || {
            lower_thread_priority();
            controls.joined(ActionOrigin::Terminal);
            let drawn = draw_until_over(screen, &views, &*controls, &info, &stop, &ends);
            let restored = restore();
            controls.left(ActionOrigin::Terminal);
            if let Err(error) = drawn.and(restored) {
                tracing::error!("the terminal cannot be drawn on any more: {error}");
            }
        };
        let thread = thread::Builder::new().name("terminal".to_owned()).spawn(run);
        Ok(Self { over, thread: Some(thread.map_err(ConsoleError::Start)?) })
    }
}

impl Drop for Terminal {
    /// Gives the terminal back as it was.
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // The thread has reported its own error.
            let _ = thread.join();
        }
    }
}

type ScreenOnStderr = Screen<CrosstermBackend<io::Stderr>>;

/// Draws on standard error, as all messages do; results go to standard output.
fn take() -> io::Result<ScreenOnStderr> {
    enable_raw_mode()?;
    execute!(io::stderr(), EnterAlternateScreen, cursor::Hide)
        .and_then(|()| Screen::new(CrosstermBackend::new(io::stderr())))
        .inspect_err(|_| {
            // The first error is the one to report.
            let _ = restore();
        })
}

fn restore() -> io::Result<()> {
    let left = execute!(io::stderr(), LeaveAlternateScreen, cursor::Show);
    disable_raw_mode().and(left)
}

fn draw_until_over(
    mut screen: ScreenOnStderr,
    views: &Views,
    controls: &dyn Controls,
    info: &SessionInfo,
    stop: &AtomicBool,
    over: &AtomicBool,
) -> io::Result<()> {
    let mut input = KeyInput::default();
    let (mut snapshot, mut history) = (views.snapshot(), views.history());
    while !over.load(Ordering::Acquire) {
        let latest = snapshot.borrow_and_update().clone();
        let events = history.borrow_and_update().clone();
        screen.draw(|frame| draw::draw(frame, &latest, &events, info, &input))?;
        if !event::poll(DRAW_PERIOD)? {
            continue;
        }
        let Key::Key(key) = event::read()? else { continue };
        match input.press(key, &latest) {
            Some(KeyAction::Request(request)) => controls.request(request, ActionOrigin::Terminal),
            Some(KeyAction::Stop) => stop.store(true, Ordering::Relaxed),
            None => {}
        }
    }
    Ok(())
}
