//! The rig file: what is on the bus, what its numbers mean, and what may never be exceeded.

mod error;
mod identifiers;
mod layout;
mod motors;
mod rig_file;
mod rules;
mod schema;
mod signals;
mod valid;

pub use error::CanRigFileError;
pub use motors::*;
pub use rig_file::*;
pub use schema::schema;
pub use signals::*;
pub use valid::ValidRigFile;
