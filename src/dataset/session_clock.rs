//! When samples of a session were measured, on the clocks of the computer.

use std::path::Path;

use super::csv_input::SessionFolder;
use super::error::DatasetError;
use super::journal::{JOURNAL, JournalEntry, JournalText};
use super::recovery::RecoveredSession;
use super::utc::utc_text;
use crate::timing::ClockStamp;

/// A sample whose time is known.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct StampedSample {
    /// Stretch of the session, as in [`super::RampTime`].
    pub stretch: usize,
    /// Time in its stretch, s.
    pub time_s: f64,
    /// When the program had it.
    pub stamp: ClockStamp,
}

/// The samples of a session whose times are known: the first of each stretch, and the first of each trial.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SessionClock {
    /// The samples, in order.
    pub stamped: Vec<StampedSample>,
}

impl SessionClock {
    /// Reads that of the session in `folder`; empty for a session that was simulated, measured elsewhere, or by an older program.
    ///
    /// # Errors
    /// If the session cannot be read.
    pub fn read(folder: &Path) -> Result<Self, DatasetError> {
        if !SessionFolder::open(folder)?.folder().contains(JOURNAL) {
            return Ok(Self::default());
        }
        let session = RecoveredSession::read(folder)?;
        Ok(Self::of_journal(&session.journal, session.settings.sample_rate_hz))
    }

    fn of_journal(journal: &JournalText, sample_rate_hz: f64) -> Self {
        let mut stretch = 0;
        let mut stamped = Vec::new();
        for placed in &journal.records {
            match &placed.record {
                JournalEntry::Resumed { .. } => stretch += 1,
                JournalEntry::Transition(transition) => stretch += usize::from(!transition.to.is_armed()),
                JournalEntry::Clock { sample, stamp } => {
                    stamped.push(StampedSample {
                        stretch,
                        time_s: *sample as f64 / sample_rate_hz,
                        stamp: *stamp,
                    });
                }
                _ => {}
            }
        }
        Self { stamped }
    }

    /// UTC of a time in a stretch, ns since 1970, from the last known sample before it; `None` where no sample of the stretch is known.
    pub fn utc_ns(&self, stretch: usize, time_s: f64) -> Option<i64> {
        let own = self.stamped.iter().filter(|known| known.stretch == stretch);
        let known = own.clone().rev().find(|known| known.time_s <= time_s).or_else(|| own.clone().next())?;
        Some(known.stamp.utc_ns + libm::round((time_s - known.time_s) * 1e9) as i64)
    }
}

/// A time in ns since 1970 as text with microseconds: `2026-11-24T15:00:00.000000Z`.
pub fn utc_text_us(utc_ns: i64) -> String {
    let whole = utc_text(utc_ns.div_euclid(1_000_000_000));
    format!("{}.{:06}Z", whole.trim_end_matches('Z'), utc_ns.rem_euclid(1_000_000_000) / 1000)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_is_counted_from_the_last_known_sample_of_its_stretch() {
        let at = |stretch, time_s, utc_ns| StampedSample {
            stretch,
            time_s,
            stamp: ClockStamp { utc_ns, monotonic_ns: 0, lsl_s: None, read_within_ns: 0 },
        };
        let hour_ns = 3_600_000_000_000;
        let clock =
            SessionClock { stamped: vec![at(0, 0.0, 0), at(0, 10.0, 10_000_500_000), at(2, 0.0, hour_ns)] };
        assert_eq!(clock.utc_ns(0, 9.0), Some(9_000_000_000));
        assert_eq!(clock.utc_ns(0, 12.0), Some(12_000_500_000));
        assert_eq!(clock.utc_ns(1, 3.0), None);
        assert_eq!(clock.utc_ns(2, 1.5), Some(hour_ns + 1_500_000_000));
        assert_eq!(utc_text_us(hour_ns + 1_500_000_000), "1970-01-01T01:00:01.500000Z");
    }
}
