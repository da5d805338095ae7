//! What the verbs of the command line share. A verb imports from here and from the library, never from another verb.
//!
//! This module belongs to the program and not to the library: it prints messages, asks the operator and chooses exit codes.

mod command_line_operator;
mod console;
mod console_options;
mod failure;
mod motor_operator;
mod new_session;
mod pace;
mod session_results;
mod session_rig;
mod session_runner;
mod signals;

pub use console::Console;
pub use console_options::{ConsoleOptions, PageOptions, SessionDescription};
pub use failure::Failure;
pub use new_session::{draw_seed, new_folder, subject_number};
pub use pace::Pace;
pub use session_results::finish_session;
pub use session_rig::{
    SessionRig, StoredVirtualRig, is_can_rig_file, open_seal, ran_on_can_motor, read_stored_virtual_rig,
    with_hidden_effect,
};
pub use session_runner::{SessionRun, confirm_motion};
pub use signals::stop_on_signals;
