//! The clock of Lab Streaming Layer beside that of the operating system.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::library::LslLibrary;
use crate::timing::beside_monotonic;

/// Where the clock of Lab Streaming Layer is, as the thread that calls the library last read it.
#[derive(Debug, Clone)]
pub struct LslClock(Arc<AtomicU64>);

impl LslClock {
    /// A clock that was not read yet.
    pub(super) fn unknown() -> Self {
        Self(Arc::new(AtomicU64::new(f64::NAN.to_bits())))
    }

    /// Reads where it is now.
    pub(super) fn read(&self, library: &LslLibrary) {
        let (now_s, at_ns, _) = beside_monotonic(|| library.now_s());
        self.0.store((now_s - at_ns as f64 * 1e-9).to_bits(), Ordering::Relaxed);
    }

    /// How far it is ahead of the monotonic clock, s; `None` before the streams are open.
    pub fn ahead_s(&self) -> Option<f64> {
        let ahead_s = f64::from_bits(self.0.load(Ordering::Relaxed));
        ahead_s.is_finite().then_some(ahead_s)
    }
}
