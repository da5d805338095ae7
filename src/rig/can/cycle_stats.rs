//! Counts of what the cycle did, kept with the session.

use crate::timing::Histogram;

/// Counts of what the cycle did, kept with the session.
#[derive(Debug, Clone, Default)]
pub struct CycleStats {
    /// Periods.
    pub periods: u64,
    /// Periods whose frames came too late.
    pub missed: u64,
    /// Wake-ups that were late by a period or more.
    pub overruns: u64,
    /// Frames that came twice.
    pub duplicates: u64,
    /// By how much the program woke up late.
    pub lateness: Histogram,
    /// Time from SYNC to the last frame of the period.
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
