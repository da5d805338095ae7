//! The protocol file: velocities, torques, gate, ramp, limits.
//!
//! A protocol is a JSON file. [`Protocol::parse`] returns a [`ValidProtocol`] or an error that lists all mistakes:
//!
//! ```
//! use ramphold::protocol::Protocol;
//!
//! let text = include_str!("../../protocols/quick.json");
//! let protocol = Protocol::parse(text, "quick.json")?;
//! assert_eq!(protocol.velocities_rad_s.len() * protocol.torques_nm.len(), 4);
//!
//! let in_degrees = text.replace("[1.3, 3.25]", "[74.5, 186.2]");
//! let error = Protocol::parse(&in_degrees, "quick.json").unwrap_err();
//! assert!(error.to_string().contains("looks like deg/s"));
//! # Ok::<(), ramphold::protocol::ProtocolError>(())
//! ```

mod duration;
mod error;
mod examples;
mod multisine;
mod rig_load;
mod rig_trial_block;
mod rig_trials;
mod rules;
mod schema;
pub(crate) mod shape;
pub(crate) mod source;
mod trajectory;
mod types;
mod units;
mod valid;

pub use duration::{APPROACH_S, Duration};
pub use error::{Problem, ProtocolError};
pub use examples::EXAMPLES;
pub use multisine::Multisine;
pub use rig_load::{GRAVITY_M_S2, RigLoad};
pub use rig_trial_block::{BlockMotion, RigTrialBlock};
pub use rig_trials::{MOUNTING_S, PlannedRigTrial, RIG_REST_S, RIG_SETTLE_S, RigMotion, SEAT_SUBJECT};
pub use schema::schema_text;
pub use trajectory::{Motion, RampAndHold, Sweep, TooShort};
pub use types::*;
pub use units::{minutes, significant};
pub use valid::ValidProtocol;
