//! Time: the clock, a timer for periodic work, a histogram of how late it began, and the times of samples.

mod clock;
mod clock_stamp;
mod histogram;
mod periodic_timer;
mod sample_clock;

pub use clock::{Clock, SystemClock, VirtualClock};
pub use clock_stamp::{ClockStamp, beside_monotonic, monotonic_ns};
pub use histogram::Histogram;
pub use periodic_timer::PeriodicTimer;
pub use sample_clock::SampleClock;
