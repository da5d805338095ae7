//! The rig file: what is on the bus, what its numbers mean, and what may never be exceeded.

mod drive_numbers;
mod error;
mod identifiers;
mod layout;
mod misfits;
mod motors;
mod problems;
mod rig_file;
mod rules;
mod schema;
mod signals;
mod valid;

pub use drive_numbers::unholdable;
pub use error::CanRigFileError;
pub use motors::*;
pub use rig_file::*;
pub use schema::schema;
pub use signals::*;
pub use valid::ValidRigFile;
