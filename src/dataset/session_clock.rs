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
    /// Run of the program on the session, from 1.
    pub run: usize,
    /// When the program had it.
    pub stamp: ClockStamp,
}

/// The samples of a session whose times are known: the first of each stretch, and the first of each trial.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct SessionClock {
    /// The samples, in order.
    pub stamped: Vec<StampedSample>,
    /// Runs of the program on the session.
    pub runs: usize,
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
        let (mut stretch, mut run) = (0, 1);
        let mut stamped = Vec::new();
        for placed in &journal.records {
            match &placed.record {
                JournalEntry::Resumed { .. } => (stretch, run) = (stretch + 1, run + 1),
                JournalEntry::Transition(transition) => stretch += usize::from(!transition.to.is_armed()),
                JournalEntry::Clock { sample, stamp } => {
                    stamped.push(StampedSample {
                        stretch,
                        // The number counts the sample itself; transitions and times count those before it.
                        time_s: sample.saturating_sub(1) as f64 / sample_rate_hz,
                        run,
                        stamp: *stamp,
                    });
                }
                _ => {}
            }
        }
        Self { stamped, runs: run }
    }

    /// A time in a stretch on the clock of Lab Streaming Layer, s; `None` where no sample of the stretch is known on it. A sample is had
    /// late, never early: it is counted from where the least late ones are.
    pub fn lsl_s(&self, stretch: usize, time_s: f64) -> Option<f64> {
        let on_lsl = |known: &StampedSample| {
            let late_s = known.stamp.late_ns.unwrap_or(0) as f64 * 1e-9;
            Some((known.time_s, known.stamp.lsl_s? - late_s))
        };
        let own = || self.stamped.iter().filter(move |known| known.stretch == stretch).filter_map(on_lsl);
        let (known_s, lsl_s) = own().rfind(|known| known.0 <= time_s).or_else(|| own().next())?;
        Some(lsl_s + (time_s - known_s) * speed(&own().collect::<Vec<_>>()))
    }

    /// The run of the program in which a stretch was measured, where a sample of it is known.
    pub fn run_of(&self, stretch: usize) -> Option<usize> {
        self.stamped.iter().find(|known| known.stretch == stretch).map(|known| known.run)
    }

    /// UTC of a time in a stretch, ns since 1970, from the last known sample before it; `None` where no sample of the stretch is known.
    /// Counted from where the least late samples are, as [`SessionClock::lsl_s`].
    pub fn utc_ns(&self, stretch: usize, time_s: f64) -> Option<i64> {
        let own = self.stamped.iter().filter(|known| known.stretch == stretch);
        let known = own.clone().rev().find(|known| known.time_s <= time_s).or_else(|| own.clone().next())?;
        let had_in_time_ns = known.stamp.utc_ns - known.stamp.late_ns.unwrap_or(0);
        Some(had_in_time_ns + libm::round((time_s - known.time_s) * 1e9) as i64)
    }
}

/// Shortest time over which the speeds of two clocks are compared, s.
const COMPARED_S: f64 = 30.0;

/// How much faster the second of two clocks runs, by the line through pairs of their times; 1 where they are not known for long enough.
fn speed(pairs: &[(f64, f64)]) -> f64 {
    let (Some(first), Some(last)) = (pairs.first(), pairs.last()) else { return 1.0 };
    if last.0 - first.0 < COMPARED_S {
        return 1.0;
    }
    let count = pairs.len() as f64;
    let mean = pairs.iter().fold((0.0, 0.0), |sum, pair| (sum.0 + pair.0 / count, sum.1 + pair.1 / count));
    let centred = || pairs.iter().map(|pair| (pair.0 - mean.0, pair.1 - mean.1));
    centred().map(|(a, b)| a * b).sum::<f64>() / centred().map(|(a, _)| a * a).sum::<f64>()
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
            run: 1,
            stamp: ClockStamp { utc_ns, monotonic_ns: 0, lsl_s: None, late_ns: None, read_within_ns: 0 },
        };
        let hour_ns = 3_600_000_000_000;
        let clock = SessionClock {
            stamped: vec![at(0, 0.0, 0), at(0, 10.0, 10_000_500_000), at(2, 0.0, hour_ns)],
            runs: 1,
        };
        assert_eq!(clock.utc_ns(0, 9.0), Some(9_000_000_000));
        assert_eq!(clock.utc_ns(0, 12.0), Some(12_000_500_000));
        assert_eq!(clock.utc_ns(1, 3.0), None);
        assert_eq!(clock.utc_ns(2, 1.5), Some(hour_ns + 1_500_000_000));
        assert_eq!(utc_text_us(hour_ns + 1_500_000_000), "1970-01-01T01:00:01.500000Z");
    }

    #[test]
    fn the_first_sample_of_a_trial_is_placed_by_its_own_stamp() {
        let line = |json: &str| {
            let record = serde_json::from_str(json).unwrap();
            super::super::journal::JournalLine { offset: 0, record }
        };
        let records = vec![
            line(r#"{"record":"clock","sample":1,"stamp":{"utc_ns":0,"monotonic_ns":0,"read_within_ns":0}}"#),
            line(
                r#"{"record":"clock","sample":5001,"stamp":{"utc_ns":2000700000,"monotonic_ns":0,"read_within_ns":0}}"#,
            ),
            line(
                r#"{"record":"happened","sample":5000,"from":"rest","event":"rest_over","to":"hold","detail":{"began":{"number":1,"practice":false,"position":1,"rest_samples":5000}}}"#,
            ),
        ];
        let clock = SessionClock::of_journal(&JournalText { records, ..JournalText::default() }, 2500.0);
        assert_eq!(clock.utc_ns(0, 5000.0 / 2500.0), Some(2_000_700_000));
        assert_eq!(clock.utc_ns(0, 5001.0 / 2500.0), Some(2_001_100_000));
    }

    /// Stamps every 10 s of samples whose clock is 80 ppm slow, had up to 2 ms late.
    #[test]
    fn a_time_does_not_depend_on_how_late_a_sample_was_had() {
        let on_lsl = |time_s: f64| 500.0 + time_s * (1.0 + 80e-6);
        let stamped = (0..30u32).map(|at| {
            let (time_s, late_ns) = (10.0 * f64::from(at), i64::from(at * 7919 % 20) * 100_000);
            let lsl_s = Some(on_lsl(time_s) + late_ns as f64 * 1e-9);
            let utc_ns = (time_s * 1e9) as i64 + late_ns;
            let stamp =
                ClockStamp { utc_ns, monotonic_ns: 0, lsl_s, late_ns: Some(late_ns), read_within_ns: 0 };
            StampedSample { stretch: 1, time_s, run: 2, stamp }
        });
        let clock = SessionClock { stamped: stamped.collect(), runs: 2 };
        for time_s in [3.0, 57.5, 299.0] {
            let found = clock.lsl_s(1, time_s).unwrap();
            assert!((found - on_lsl(time_s)).abs() < 1e-6, "{time_s}: {}", found - on_lsl(time_s));
            assert_eq!(clock.utc_ns(1, time_s), Some((time_s * 1e9) as i64));
        }
        assert_eq!((clock.lsl_s(0, 1.0), clock.run_of(1), clock.run_of(0)), (None, Some(2), None));
    }
}
