//! Reads the analog channels of C3D files, which systems for motion capture write.
//!
//! "The C3D File Format", c3d.org: a header of 512 bytes, a section of named parameters, then frames. A frame has the positions of the
//! markers, which are passed over, and some samples of each analog channel. Every count is stated more than once; a file whose counts
//! contradict each other is refused.

mod analog;
mod layout;
mod parameters;
mod processor;

pub use analog::read;
pub use layout::is_c3d;

#[cfg(test)]
mod tests;
