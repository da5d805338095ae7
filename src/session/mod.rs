//! The experiment as a state machine: `(state, input) -> (state, output)`, stepped once a sample.
//!
//! It has no clock, file or socket: time is a number of samples, and what it must remember over a crash is told in
//! [`Happening`]s that a journal keeps. Which phase may follow which is data, see [`transitions`].

mod control_loop;
mod event;
mod io;
mod lateness;
mod machine;
mod phase;
mod progress;
mod rng_streams;
pub mod rules;
mod settings;
mod smoothing;
pub mod transitions;
mod watch;

pub use control_loop::{AsFastAsItGoes, Clock, Operator, RealTime, Recorder, conduct};
pub use event::{Event, Source};
pub use io::{Attempt, Detail, Happening, Input, Output, Reading, Recording, Status};
pub use lateness::Lateness;
pub use machine::Machine;
pub use phase::Phase;
pub use progress::Ledger;
pub use settings::{Planned, Settings};
pub use smoothing::Display;
pub use watch::Watch;

#[cfg(test)]
mod tests;
