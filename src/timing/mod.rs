//! Time: the clock, a timer for periodic work, and a histogram of how late it began.

mod clock;
mod histogram;
mod periodic_timer;

pub use clock::{Clock, SystemClock, VirtualClock};
pub use histogram::Histogram;
pub use periodic_timer::PeriodicTimer;
