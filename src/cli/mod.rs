//! The command line: one file per verb.
//!
//! To add a verb, write `src/cli/<verb>.rs` with a `clap::Args` struct that implements `Verb` (its doc comment is the
//! verb's help), declare the file here, and add it to the list in `command_line`. Results go to standard output,
//! messages to standard error. A verb imports no other verb; what several verbs need is in [`app`](crate::app).

mod attach;
mod calibrate;
mod check;
mod cohort;
mod command_line;
mod completions;
mod console;
mod design;
mod diagnose;
mod export;
mod fit;
mod import;
mod new;
mod power;
mod replay;
pub(crate) mod report;
mod resume;
mod reveal;
mod rig;
mod run;
mod schedule;
mod schema;
mod sessions;
mod states;
mod trials;
mod verb;
mod verify;
mod watch;

pub use command_line::{CommandLine, VERSION, main, run_program};
