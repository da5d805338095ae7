//! The console in a terminal, for who has no browser there.

mod draw;
mod keys;

use std::io;
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

use super::welcome::SessionInfo;
use super::{ConsoleError, Controls, Views, nice};
use keys::{KeyAction, KeyInput};

/// Time between two pictures.
const PERIOD: Duration = Duration::from_millis(50);

/// Checks that the program can draw on a terminal: that the feature `terminal` is built.
///
/// # Errors
/// Never, in a program that is built with the feature.
pub fn check() -> Result<(), ConsoleError> {
    Ok(())
}

/// The terminal, being drawn on until this is dropped.
pub struct Terminal {
    over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
}

impl Terminal {
    /// Takes the terminal. `stop` is set when the operator presses Ctrl-C twice.
    ///
    /// # Errors
    /// If there is none.
    pub fn open(
        views: Views,
        controls: Arc<dyn Controls>,
        about: SessionInfo,
        stop: Arc<AtomicBool>,
    ) -> Result<Self, ConsoleError> {
        let screen = take().map_err(ConsoleError::Terminal)?;
        let over = Arc::new(AtomicBool::new(false));
        let ends = over.clone();
        let work = move || {
            nice();
            controls.joined(crate::dataset::ActionOrigin::Terminal);
            let worked = work(screen, &views, &*controls, &about, &stop, &ends);
            let given_back = give_back();
            controls.left(crate::dataset::ActionOrigin::Terminal);
            if let Err(error) = worked.and(given_back) {
                tracing::error!("the terminal cannot be drawn on any more: {error}");
            }
        };
        let thread = thread::Builder::new().name("terminal".to_owned()).spawn(work);
        Ok(Self { over, thread: Some(thread.map_err(ConsoleError::Start)?) })
    }
}

impl Drop for Terminal {
    /// Gives the terminal back as it was.
    fn drop(&mut self) {
        self.over.store(true, Ordering::Release);
        if let Some(thread) = self.thread.take() {
            // It said itself what went wrong.
            let _ = thread.join();
        }
    }
}

type Drawn = Screen<CrosstermBackend<io::Stderr>>;

/// On standard error, as all that is said to the person at the terminal: results go to standard output.
fn take() -> io::Result<Drawn> {
    enable_raw_mode()?;
    execute!(io::stderr(), EnterAlternateScreen, cursor::Hide)
        .and_then(|()| Screen::new(CrosstermBackend::new(io::stderr())))
        .inspect_err(|_| {
            // What was taken is given back; the first error is the one to tell.
            let _ = give_back();
        })
}

fn give_back() -> io::Result<()> {
    let left = execute!(io::stderr(), LeaveAlternateScreen, cursor::Show);
    disable_raw_mode().and(left)
}

fn work(
    mut screen: Drawn,
    views: &Views,
    controls: &dyn Controls,
    about: &SessionInfo,
    stop: &AtomicBool,
    over: &AtomicBool,
) -> io::Result<()> {
    let mut desk = KeyInput::default();
    let (mut now, mut story) = (views.now(), views.story());
    while !over.load(Ordering::Acquire) {
        let latest = now.borrow_and_update().clone();
        let told = story.borrow_and_update().clone();
        screen.draw(|frame| draw::draw(frame, &latest, &told, about, &desk))?;
        if !event::poll(PERIOD)? {
            continue;
        }
        let Key::Key(key) = event::read()? else { continue };
        match desk.press(key, &latest) {
            Some(KeyAction::Ask(request)) => controls.hear(request, crate::dataset::ActionOrigin::Terminal),
            Some(KeyAction::Stop) => stop.store(true, Ordering::Relaxed),
            None => {}
        }
    }
    Ok(())
}
