//! When the trials of a session were, on one axis of time for all of them.
//!
//! Times are counted from the session's start: by UTC where the session kept when its samples were had, otherwise by its samples. Nobody then
//! knows how long a break was, and what comes after it is put behind it.

use std::path::Path;

use super::error::ExportError;
use crate::dataset::{self, RampTime, Session, SessionClock, Trial, utc_text_us};

/// What a session knows of its times.
#[derive(Debug)]
pub struct TrialTimes {
    ramps: Vec<RampTime>,
    /// Samples whose time on other clocks is known.
    pub clock: SessionClock,
    /// UTC of the zero of the axis, ns since 1970, where it is known: that of the first sample of the first stretch.
    pub origin_utc_ns: Option<i64>,
}

/// A stretch of the session without a break of its samples.
#[derive(Debug)]
pub struct PlacedStretch<'a> {
    /// UTC of the first sample of its first trial, where it is known.
    pub began_utc: Option<String>,
    /// The trials with an onset and samples, in order.
    pub trials: Vec<PlacedTrial<'a>>,
}

/// A trial with its place on the axis.
#[derive(Debug)]
pub struct PlacedTrial<'a> {
    /// The trial.
    pub trial: &'a Trial,
    rate_hz: f64,
    /// First sample in the stretch, s.
    start_s: f64,
    /// Onset in the stretch, s.
    ramp_s: f64,
    axis: TrialAxis,
}

/// How a time in a stretch becomes one on the axis.
#[derive(Debug)]
enum TrialAxis {
    /// By the time stamp of the trial, which began then, s.
    Stamped { began_s: f64 },
    /// By the zero of the stretch, s.
    Counted { zero_s: f64 },
}

/// Where the zero of a stretch is on the axis, and when its first trial began.
#[derive(Debug, Clone, PartialEq)]
struct StretchPlace {
    zero_s: f64,
    began_utc: Option<String>,
}

impl TrialTimes {
    /// Reads those of the session in `folder`, for a file of the format named.
    ///
    /// # Errors
    /// If the session cannot be read, or has no journal and so no times.
    pub fn read(folder: &Path, format: &'static str) -> Result<Self, ExportError> {
        let ramps = dataset::ramp_times(folder)?
            .ok_or_else(|| ExportError::NoTimes { session: folder.into(), format })?;
        let clock = SessionClock::read(folder)?;
        let origin_utc_ns = ramps.first().and_then(|ramp| clock.utc_ns(ramp.stretch, 0.0));
        Ok(Self { ramps, clock, origin_utc_ns })
    }

    /// The trials of `session` in their places.
    pub fn place<'a>(&self, session: &'a Session) -> Vec<PlacedStretch<'a>> {
        let mut end_s = 0.0_f64;
        let mut stretches = Vec::new();
        for ramps in self.ramps.chunk_by(|a, b| a.stretch == b.stretch) {
            let recorded: Vec<(&RampTime, &Trial, f64)> = ramps
                .iter()
                .filter_map(|ramp| {
                    let trial = trial(session, ramp)?;
                    Some((ramp, trial, ramp.onset_s - (trial.onset_s? - trial.record.start_s)))
                })
                .collect();
            let first_s = recorded.first().map_or(0.0, |(_, _, start_s)| *start_s);
            let StretchPlace { zero_s, began_utc } =
                place(ramps, &self.clock, self.origin_utc_ns, (first_s, end_s));
            let placed = recorded.into_iter().map(|(ramp, trial, start_s)| PlacedTrial {
                trial,
                rate_hz: session.sample_rate_hz,
                start_s,
                ramp_s: ramp.onset_s,
                // Each trial by its own stamp: the crystal of the samples runs unlike that of the computer.
                axis: match self.clock.utc_ns(ramp.stretch, start_s).zip(self.origin_utc_ns) {
                    Some((began_ns, origin_ns)) => {
                        TrialAxis::Stamped { began_s: (began_ns - origin_ns) as f64 * 1e-9 }
                    }
                    None => TrialAxis::Counted { zero_s },
                },
            });
            let trials: Vec<PlacedTrial> = placed.collect();
            end_s = trials.iter().map(PlacedTrial::end_s).fold(end_s, f64::max);
            stretches.push(PlacedStretch { began_utc, trials });
        }
        stretches
    }
}

impl PlacedTrial<'_> {
    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.trial.record.theta_m_rad.len()
    }

    /// Time of a sample, counted from 0, s.
    pub fn sample_s(&self, sample: usize) -> f64 {
        self.at(self.start_s + sample as f64 / self.rate_hz)
    }

    /// Time that has `record_s` on the axis of the trial's record, s.
    #[cfg(feature = "matlab")]
    pub fn record_s(&self, record_s: f64) -> f64 {
        self.at(self.start_s + record_s - self.trial.record.start_s)
    }

    /// Time of the onset, s.
    pub fn onset_s(&self) -> f64 {
        self.at(self.ramp_s)
    }

    /// Time at which the last sample is over, s.
    pub fn end_s(&self) -> f64 {
        self.sample_s(self.samples())
    }

    fn at(&self, time_s: f64) -> f64 {
        match self.axis {
            TrialAxis::Stamped { began_s } => began_s + (time_s - self.start_s),
            TrialAxis::Counted { zero_s } => zero_s + time_s,
        }
    }
}

/// The trial of a ramp, if it has samples.
fn trial<'a>(session: &'a Session, ramp: &RampTime) -> Option<&'a Trial> {
    let trial = session.trials.iter().find(|trial| Some(trial.number) == ramp.trial)?;
    (!trial.record.theta_m_rad.is_empty()).then_some(trial)
}

/// The place of a stretch with the ramps `ramps`, before which the axis ends at `end_s`. `origin_utc_ns` is that of the axis's zero.
fn place(
    ramps: &[RampTime],
    clock: &SessionClock,
    origin_utc_ns: Option<i64>,
    (first_s, end_s): (f64, f64),
) -> StretchPlace {
    let stretch = ramps.first().map_or(0, |ramp| ramp.stretch);
    let began_ns = clock.utc_ns(stretch, first_s);
    match began_ns.zip(origin_utc_ns) {
        Some((began_ns, origin_ns)) => StretchPlace {
            zero_s: (began_ns - origin_ns) as f64 * 1e-9 - first_s,
            began_utc: Some(utc_text_us(began_ns)),
        },
        // Samples are counted on over a time without power, and from 0 again after a program that was begun anew.
        None => StretchPlace { zero_s: (end_s - first_s).max(0.0), began_utc: None },
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::StampedSample;
    use crate::timing::ClockStamp;

    fn ramp(stretch: usize, onset_s: f64) -> RampTime {
        RampTime { stretch, trial: Some(1), onset_s }
    }

    #[test]
    fn a_stretch_is_where_utc_has_it_and_without_utc_behind_what_was_before() {
        let stamp =
            |utc_ns| ClockStamp { utc_ns, monotonic_ns: 0, lsl_s: None, late_ns: None, read_within_ns: 0 };
        let stamped = vec![
            StampedSample { stretch: 0, time_s: 0.0, run: 1, stamp: stamp(1_000_000_000) },
            StampedSample { stretch: 1, time_s: 0.0, run: 1, stamp: stamp(601_000_000_000) },
        ];
        let (known, unknown) = (SessionClock { stamped, runs: 1 }, SessionClock::default());
        let placed =
            |stretch, clock: &SessionClock, origin| place(&[ramp(stretch, 9.0)], clock, origin, (8.0, 50.0));
        let at = |found: StretchPlace| (found.zero_s, found.began_utc);
        let began = "1970-01-01T00:10:09.000000Z".to_owned();
        assert_eq!(at(placed(1, &known, Some(1_000_000_000))), (600.0, Some(began)));
        // Resumed: counted from 0 again, and put behind what was before.
        assert_eq!(at(placed(1, &unknown, None)), (42.0, None));
        // Armed again: the count goes on.
        assert_eq!(at(place(&[ramp(1, 81.0)], &unknown, None, (80.0, 50.0))), (0.0, None));
    }
}
