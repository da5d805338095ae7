//! What the verbs of the command line share. A verb imports from here and from the library, never from another verb.
//!
//! This module belongs to the program and not to the library: it prints messages, asks the operator and chooses exit codes.

mod console;
mod failure;

pub use console::Console;
pub use failure::Failure;
