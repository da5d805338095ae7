//! Takes the place of the console in a terminal where the feature `terminal` is not built.

use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use super::controls::Controls;
use super::error::ConsoleError;
use super::view_model::Views;
use super::welcome::SessionInfo;

/// A terminal that is drawn on: without the feature there is none.
pub enum Terminal {}

/// Checks that the program can draw on a terminal.
///
/// # Errors
/// Always: the feature is not built.
pub fn check() -> Result<(), ConsoleError> {
    Err(ConsoleError::NotBuilt { option: "--tui", feature: "terminal" })
}

impl Terminal {
    /// Refuses.
    ///
    /// # Errors
    /// Always: the feature is not built.
    pub fn open(
        _views: Views,
        _controls: Arc<dyn Controls>,
        _info: SessionInfo,
        _stop: Arc<AtomicBool>,
    ) -> Result<Self, ConsoleError> {
        Err(ConsoleError::NotBuilt { option: "--tui", feature: "terminal" })
    }
}
