//! Counts of what the cycle did, kept with the session.

use std::time::Duration;

use crate::rig::Punctuality;
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
    /// Periods without new readings: points of the grid that the program slept through, and frames that were lost.
    pub lost_periods: u64,
    /// What of it happened since the punctuality was taken last.
    recent: Punctuality,
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
    /// Adds a period: by how much the program woke up late, and the time from the last SYNC to this one.
    pub fn begin_period(&mut self, late: Duration, gap: Duration) {
        self.lateness.add(late);
        let us = |duration: Duration| duration.as_micros() as u64;
        self.recent.add(Punctuality { lost_periods: 0, longest_gap_us: us(gap), latest_us: us(late) });
    }

    /// Adds periods without new readings.
    pub fn lose_periods(&mut self, periods: u64) {
        self.lost_periods += periods;
        self.recent.lost_periods += periods;
    }

    /// How punctual the periods were since this was asked last.
    pub fn take_punctuality(&mut self) -> Punctuality {
        std::mem::take(&mut self.recent)
    }

    /// Load of a bus that carries so many bits a second, 0 to 1.
    pub fn load(&self, bits_per_s: f64) -> f64 {
        let capacity = self.seconds * bits_per_s;
        if capacity > 0.0 { self.bits as f64 / capacity } else { 0.0 }
    }
}
