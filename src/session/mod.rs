//! The experiment as a state machine: `(state, input) -> (state, output)`, stepped once a sample.
//!
//! It has no clock, file or socket: time is a number of samples, and what it must remember over a crash is told in
//! [`Happening`]s that a journal keeps. Which phase may follow which is data, see [`table`].

mod conduct;
mod display;
mod lateness;
mod ledger;
mod machine;
mod names;
pub mod rules;
mod settings;
mod step;
pub mod table;
mod watch;
mod words;

pub use conduct::{AsFastAsItGoes, Clock, Operator, RealTime, Recorder, conduct};
pub use display::Display;
pub use lateness::Lateness;
pub use ledger::Ledger;
pub use machine::Machine;
pub use settings::{Planned, Settings};
pub use step::{Attempt, Detail, Happening, Input, Output, Reading, Recording, Status};
pub use watch::Watch;
pub use words::{Event, Phase, Source};

#[cfg(test)]
mod tests;
