//! The console: what operator and subject see while a session runs, and the way of the operator's commands.
//!
//! The control loop hands each step to a [`StepFeed`] and polls a [`CommandReceiver`] for commands; it waits for neither.
//! The [`ViewModel`] makes snapshots of the steps. Web pages ([`web`]) and the [`terminal`] draw the latest snapshot. A
//! recorded session is shown in the same way ([`player`]). Between the sessions of a laboratory the pages show a
//! [`LaboratoryView`].
//!
//! Layers, bottom up: step_feed, commands, controls -> trial_fits, ramps, reflexes, history -> view_model, laboratory_view -> web, terminal -> live, player.

mod coming_and_going;
mod command_questions;
mod commands;
mod controls;
mod display_latency;
mod error;
mod fitter;
mod history;
mod laboratory_view;
mod live;
mod playback_time;
pub mod player;
mod presence;
mod ramps;
mod reflexes;
mod snapshot;
mod step_feed;
mod strip_chart;
#[cfg(feature = "terminal")]
pub mod terminal;
#[cfg(not(feature = "terminal"))]
#[path = "without_terminal.rs"]
pub mod terminal;
mod thread_priority;
mod time_left;
mod trial_fits;
mod view_model;
pub mod web;
mod welcome;

pub use command_questions::{CommandQuestions, SETS_ORIGIN_HERE};
pub use commands::{CommandReceiver, CommandSender, OperatorNotice};
pub use controls::{Controls, Part, Request};
pub use display_latency::{DisplayLatencies, DisplayLatency};
pub use error::ConsoleError;
pub use fitter::{Fitter, SessionSoFar, TrialFit, TrialFitContext, TrialFitOutcome};
pub use laboratory_view::{
    Choice, LaboratoryControls, LaboratoryPublisher, LaboratoryRequest, LaboratoryView, ListEntry,
    ListedCheck, ListedSession, Notice, Outcome,
};
pub use live::{ConsoleSetup, Live, Pages};
pub use snapshot::{CurrentTrial, Instruction, PlaybackState, Snapshot, SubjectView};
pub use step_feed::{SampleCounter, StepFeed, TimedStep};
pub use strip_chart::{BIN_S, Bin};
pub(crate) use thread_priority::lower_thread_priority;
pub use view_model::{ViewModel, Views};
pub use web::PageAddresses;
pub use welcome::SessionInfo;
