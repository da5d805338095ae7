//! The order of the trials, drawn from a seed.
//!
//! The same seed gives the same order on every platform and in every later version: the draws are this crate's own
//! ([`crate::random`]), and the tests hold golden orders.
//!
//! ```
//! use ramphold::{protocol::Protocol, schedule};
//!
//! let protocol = Protocol::parse(include_str!("../../protocols/de-vlugt-2011.json"), "de-vlugt-2011.json")?;
//! let order = schedule::draw(&protocol, 1, None)?;
//! assert_eq!(order.len(), 36);
//! assert_eq!(order, schedule::draw(&protocol, 1, None)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod constrained;
mod drawing;
mod error;
mod williams;

pub use drawing::{ScheduledTrial, draw, familiarisation, put_back, write_csv};
pub use error::DrawError;

#[cfg(test)]
mod tests;
