//! What a session's signals say against its own table, before anything is fitted.
//!
//! A session that parses can still be wrong: degrees for radians, a torque of the wrong sign, an onset 20 ms early. Any of
//! these gives a fit with numbers in it. Each [`SignalCheck`] measures something in the records that the table states too, or that
//! a wrist cannot do, and [`contradictions`] lists what disagrees with its likely cause.
//!
//! The limits lie between what honest rigs, gauges and subjects do and what mistakes of units, signs and times do.
//! `docs/explanation/input-checks.md` gives the reason of each.

mod clipped;
mod contradiction;
mod emg;
mod frozen_emg;
mod frozen_watch;
mod held_samples;
mod hold;
mod hold_jump;
mod lever;
mod likely_mistake;
mod measured_trial;
mod onset;
mod ramp;
mod repeated_record;
mod resistance;
mod samples_of_ramp;
mod session_check;
mod signal_check;
mod spike;
mod trial_list;
mod wrong_row;
mod zero_torque;

pub use contradiction::{Contradiction, Contradictions, measured_and_expected};
pub use frozen_emg::check_frozen;
pub use frozen_watch::{EmgChange, FrozenWatch};
pub use measured_trial::MeasuredTrial;
pub(crate) use repeated_record::first_repeated;
pub use session_check::{check, check_with_gains, contradictions};
pub use signal_check::{SignalCheck, UnknownCheck};

#[cfg(test)]
mod tests;
