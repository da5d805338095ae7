//! Recordings of other devices, aligned with the trials of a session.
//!
//! Another device has a clock of its own. [`align`] finds the ramps of the session in its recording, by a trigger, by markers, or by
//! a signal that both have; [`Aligned::write`] cuts the recording into trials and puts them beside the raw data, with what is known
//! of the two clocks. A stream that was recorded with the session has its clock, and needs no search: [`align_stream`]. No sample is changed or resampled: each keeps its value, and gets its time on the axis of its trial.

mod aligned_ramps;
mod alignment;
mod attached_emg;
mod attachment;
mod clipping;
mod clock_jump;
mod correlation;
mod emg_check;
mod emg_warning;
mod error;
mod even_times;
mod event_match;
mod pieces;
mod ramp_places;
mod ramp_search;
mod request;
mod session_stream;
mod shared_hold;
mod shared_signal;
mod timed_table;
mod trigger;

pub use alignment::{Aligned, align};
pub use attached_emg::{
    AttachedChannel, AttachedEmg, AttachedRecording, AttachedTrial, AttachedTrialEmg, attached_emg,
    attached_recordings,
};
pub use attachment::{
    ATTACHED, AttachedStream, Attachment, AttachmentTrial, ClockComparison, ClockOffsets, FrozenEmg, LeftOut,
    RecordingGaps, StepBetweenTrials,
};
pub use clipping::ClippedEmg;
pub use emg_warning::{EmgWarning, LOWEST_ONSET_HZ, shows_onsets};
pub use error::AttachError;
pub use request::{AttachRequest, ClockSource, Reference};
pub use session_stream::align_stream;
