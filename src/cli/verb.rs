//! The trait of verbs.

use crate::app::{Console, Failure};

/// A verb of the command line, with its arguments.
pub trait Verb {
    /// Does the work; the results go to [`Console::results`].
    fn run(self, console: &Console) -> Result<(), Failure>;
}
