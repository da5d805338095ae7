//! Lab Streaming Layer: a running session as two streams that other programs on the network read, and streams of other devices that are
//! recorded with it.
//!
//! The library `liblsl` is loaded when it is asked for; the program is never linked with it. It is only called from threads of its own: the
//! control loop neither waits for it nor allocates for it.
//!
//! ```text
//! publisher           the session's end of the ring, and the thread that publishes
//! recorder            streams while a session records them, on threads of their own
//! connected_streams   the streams of a rig file: found and checked
//! stream_description  what a stream says of itself, held against the rig file
//! stream_file         a stream as it came, in an XDF file that survives the death of the program
//! stamp_watch         whether time stamps can be those of the samples
//! stream_watch        a stream that stops, as a fault of the rig
//! inlet               a stream that is taken in
//! clock               the clock of the library
//! library             liblsl: what is called, and how it is found
//! ```

mod clock;
mod connected_streams;
mod inlet;
mod library;
mod publisher;
mod recorder;
mod stamp_watch;
mod stream_description;
mod stream_file;
mod stream_watch;

pub use clock::LslClock;
pub use connected_streams::ConnectedStreams;
pub use library::{LslError, LslLibrary};
pub use publisher::{LslFeed, LslPublisher, MARKERS_STREAM, SIGNALS_STREAM};
pub use recorder::{StreamEvent, StreamRecording, TellStream};
pub use stamp_watch::stamps_off;
pub use stream_watch::{StreamWatch, WatchedRig};
