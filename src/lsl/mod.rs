//! Lab Streaming Layer: a running session as two streams that other programs on the network read.
//!
//! The library `liblsl` is loaded when it is asked for; the program is never linked with it. It is only called from a thread of its own,
//! behind a ring buffer: the control loop neither waits for it nor allocates for it.
//!
//! ```text
//! publisher      the session's end of the ring, and the thread that publishes
//! sample_clock   times of samples from the times at which the loop had them
//! library        liblsl: what is called, and how it is found
//! ```

mod library;
mod publisher;
mod sample_clock;

pub use library::{LslError, LslLibrary};
pub use publisher::{LslClock, LslFeed, LslPublisher, MARKERS_STREAM, SIGNALS_STREAM};
