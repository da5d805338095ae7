//! The experiment as a state machine: `(state, input) -> (state, output)`, stepped once a sample.
//!
//! It has no clock, file or socket. Time is counted in samples. The journal keeps each [`TransitionRecord`], from which the
//! [`Progress`] of the session is recovered after a crash. The allowed transitions are a table, see [`transitions`].

mod control_loop;
mod event;
mod every_trial_fails;
mod io;
mod machine;
mod motion;
mod pacing;
mod phase;
mod progress;
mod rng_streams;
pub mod rules;
mod settings;
mod smoothing;
mod step;
mod torque_gate;
pub mod transitions;

pub use control_loop::{Operator, run_control_loop};
pub use event::{Event, Source};
pub use every_trial_fails::EveryTrialFails;
pub use io::{
    Attempt, Input, MaximalEffort, Output, Reading, RecordTarget, RigAttempt, Status, TransitionDetail,
    TransitionRecord,
};
pub use machine::Machine;
pub use motion::MotionDeviation;
pub use pacing::{Pacing, RealTime, Unpaced};
pub use phase::Phase;
pub use progress::Progress;
pub use settings::{PlannedTrial, Settings};
pub use smoothing::FeedbackFilter;
pub use step::{Step, StepConsumer};

#[cfg(test)]
mod tests;
