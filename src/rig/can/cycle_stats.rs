//! Counts of what the cycle did, kept with the session.

use crate::timing::Histogram;

/// Counts of what the cycle did, kept with the session.
#[derive(Debug, Clone, Default)]
pub struct CycleStats {
    /// Periods.
    pub periods: u64,
    /// Periods whose frames came too late.
    pub missed: u64,
    /// Points in time that were slept through.
    pub overruns: u64,
    /// Frames that came twice.
    pub duplicates: u64,
    /// How late the program woke up.
    pub lateness: Histogram,
    /// How long the frames of a period took to come.
    pub response: Histogram,
    /// Bits sent and received in periods, at worst stuffing.
    pub bits: u64,
    /// Time in periods, s.
    pub seconds: f64,
}

impl CycleStats {
    /// Load of a bus that carries so many bits a second, 0 to 1.
    pub fn load(&self, bits_per_s: f64) -> f64 {
        let capacity = self.seconds * bits_per_s;
        if capacity > 0.0 { self.bits as f64 / capacity } else { 0.0 }
    }
}
