//! Time: the clock, a timer for periodic work, and a histogram of how late it began.

mod clock;
mod clock_stamp;
mod histogram;
mod periodic_timer;

pub use clock::{Clock, SystemClock, VirtualClock};
pub use clock_stamp::{ClockStamp, monotonic_ns};
pub use histogram::Histogram;
pub use periodic_timer::PeriodicTimer;
