//! What moves the wrist and measures it: one command in, one sample out, each period.
//!
//! A rig starts disarmed and cannot move. Only the operator's consent turns a [`Rig`] into its [`Armed`] form, and only
//! that one moves, so a program that forgets to ask does not compile.

#[cfg(any(unix, windows))]
pub mod can;
mod command;
mod fault;
mod interface;
mod limit_monitor;
mod recorded_channel;
mod sample;
mod schema;
mod stream;
mod unmeasured;
pub mod virtual_wrist;

pub use command::{Command, Cue, Direction, Motor, RigTrialStage, TrialKey, Upcoming, UpcomingRigTrial};
pub use fault::{Channel, DeviceFault, Fault, FaultClass, MOTOR_MAY_HAVE_POWER, Quantity};
pub use interface::{Armed, ArmingConsent, Origin, Punctuality, Rig, Vitals};
pub use limit_monitor::{Exceeded, LimitMonitor, MotionLimits};
pub use recorded_channel::{ChannelDetails, ChannelFilter, RecordedChannel, RecordedSignals};
pub use sample::{Sample, resolution};
pub use schema::schema_text;
pub use stream::{StreamChannel, StreamSettings, StreamTolerance, stream_mistakes};
pub use unmeasured::unmeasured_channels;
