//! A table of a recording with the times of its samples, which must go on.

use std::ops::Range;

use super::error::AttachError;
use super::pieces::RecordingPart;
use super::request::{AttachRequest, ClockSource};
use super::trigger;
use crate::import::{Recording, SourceTable, TIME_COLUMN};

/// A step longer than this many usual ones is a gap.
pub const GAP_STEPS: f64 = 1.5;

/// Longest usual step of a recording in which a ramp of some ten milliseconds can be found, s.
const SLOWEST_STEP_S: f64 = 0.02;

/// The table that is attached, with the times of its samples.
pub struct TimedTable<'a> {
    request: &'a AttachRequest,
    /// The table.
    pub table: &'a SourceTable,
    /// Times of its samples on the clock of the recording, s.
    pub times_s: Vec<f64>,
    /// Samples a second.
    pub rate_hz: f64,
    /// Samples after which a gap begins.
    pub gaps: Vec<usize>,
}

impl<'a> TimedTable<'a> {
    /// The table of a recording that the request names.
    pub fn new(request: &'a AttachRequest, recording: &'a Recording) -> Result<Self, AttachError> {
        let is_wanted =
            |table: &&SourceTable| request.table.as_ref().is_none_or(|part| table.name.contains(part));
        let wanted: Vec<&SourceTable> = recording.tables.iter().filter(is_wanted).collect();
        let [table] = wanted.as_slice() else {
            let names: Vec<&str> = recording.tables.iter().map(|table| table.name.as_str()).collect();
            let found = format!("{} tables or streams ({})", wanted.len(), names.join("; "));
            return Err(request.unexpected(found, "one; name it with --table"));
        };
        let times_s = times(request, table)?;
        if times_s.len() < 2 {
            return Err(
                request.unexpected(format!("{} samples", times_s.len()), "a recording of the session")
            );
        }
        let mut steps: Vec<f64> = times_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let usual_s = {
            let middle = steps.len() / 2;
            *steps.select_nth_unstable_by(middle, f64::total_cmp).1
        };
        if usual_s > SLOWEST_STEP_S {
            return Err(request.unexpected(
                format!("a sample every {usual_s} s"),
                "times in seconds, with many samples in a ramp; if they are in ms, divide them by 1000, or give --rate",
            ));
        }
        let is_gap = |pair: &[f64]| pair[1] - pair[0] > GAP_STEPS * usual_s;
        let gaps: Vec<usize> =
            times_s.windows(2).enumerate().filter(|(_, pair)| is_gap(pair)).map(|(at, _)| at).collect();
        // What was not sampled counts neither as samples nor as time.
        let sampled_s = times_s.windows(2).filter(|pair| !is_gap(pair)).map(|pair| pair[1] - pair[0]);
        let rate_hz = sampled_s.clone().count() as f64 / sampled_s.sum::<f64>();
        Ok(Self { request, table, times_s, rate_hz, gaps })
    }

    /// The values of a column.
    pub fn column(&self, name: &str) -> Result<&'a [f64], AttachError> {
        self.table.column(name).ok_or_else(|| {
            let found = format!("{} {}", self.table.name, self.table.why_not(name));
            self.request.unexpected(found, format!("one of {}", self.table.names()))
        })
    }

    /// The values of a column that is computed with: all are numbers.
    pub fn finite_column(&self, name: &str) -> Result<&'a [f64], AttachError> {
        let values = self.column(name)?;
        finite(self.request, self.table, name, values)?;
        Ok(values)
    }

    /// Time that the recording and a part of it have in common, s.
    pub fn length_within_s(&self, part: &RecordingPart) -> f64 {
        let (first_s, last_s) = (self.times_s[0], self.times_s[self.times_s.len() - 1]);
        (part.end.min(last_s) - part.start.max(first_s)).max(0.0)
    }

    /// Time without a sample in the gaps that a part of the recording has a share in, s.
    pub fn missing_within_s(&self, part: RecordingPart) -> f64 {
        let is_beside = |gap: &&usize| self.times_s[**gap] < part.end && self.times_s[**gap + 1] > part.start;
        self.gaps.iter().filter(is_beside).map(|gap| self.missing_s(*gap)).sum()
    }

    /// When the longest gap begins, and the time in it without a sample, s; `None` without a gap.
    pub fn longest_gap(&self) -> Option<(f64, f64)> {
        let gaps = self.gaps.iter().map(|gap| (self.times_s[*gap], self.missing_s(*gap)));
        gaps.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    fn missing_s(&self, gap: usize) -> f64 {
        self.times_s[gap + 1] - self.times_s[gap] - 1.0 / self.rate_hz
    }

    /// The samples within a part of the recording.
    pub fn samples_within(&self, part: &RecordingPart) -> Range<usize> {
        let first = self.times_s.partition_point(|time_s| *time_s <= part.start);
        first..self.times_s.partition_point(|time_s| *time_s < part.end).max(first)
    }

    /// The columns that are attached: all but that of time.
    pub fn columns(&self) -> Vec<&'a (String, Vec<f64>)> {
        let time = match &self.request.clock {
            ClockSource::Column(column) => column.as_str(),
            _ => TIME_COLUMN,
        };
        self.table.columns.iter().filter(|(name, _)| name != time).collect()
    }
}

/// Refuses values that are no numbers.
fn finite(
    request: &AttachRequest,
    table: &SourceTable,
    name: &str,
    values: &[f64],
) -> Result<(), AttachError> {
    let Some(at) = values.iter().position(|value| !value.is_finite()) else { return Ok(()) };
    let found = format!("{} in column {name:?}, sample {} of {}", values[at], at + 1, table.name);
    Err(request
        .unexpected(found, "a number in every sample of a column that is used; cut the recording there"))
}

/// Times of the samples of a table, which must go on.
fn times(request: &AttachRequest, table: &SourceTable) -> Result<Vec<f64>, AttachError> {
    let samples = table.columns.first().map_or(0, |(_, values)| values.len());
    let column = match &request.clock {
        ClockSource::Rate(rate_hz) => {
            return Ok((0..samples).map(|sample| sample as f64 / rate_hz).collect());
        }
        ClockSource::Column(column) => column.as_str(),
        ClockSource::Format => TIME_COLUMN,
    };
    let Some(times_s) = table.column(column) else {
        let found = format!("{} {}", table.name, table.why_not(column));
        let expected =
            format!("a column of time in seconds (--time) or the rate (--rate); there are {}", table.names());
        return Err(request.unexpected(found, expected));
    };
    let stops = |pair: &[f64]| pair[0].partial_cmp(&pair[1]).is_none_or(|order| order.is_ge());
    if let Some(at) = times_s.windows(2).position(stops) {
        let found =
            format!("{} s after {} s in sample {} of {}", times_s[at + 1], times_s[at], at + 2, table.name);
        let expected = if times_s[at + 1] == times_s[at] {
            "times that go on; if they are rounded, write them with more digits, or give --rate instead of --time"
        } else {
            "times that go on; did the clock jump?"
        };
        return Err(request.unexpected(found, expected));
    }
    Ok(times_s.to_vec())
}

/// The edges of a trigger.
pub struct TriggerEdges {
    /// Their times on the clock of the recording, s.
    pub times_s: Vec<f64>,
    /// The level at which the trigger is most of the time, where its pulses are said to go there.
    pub rest_on_other_side: Option<f64>,
}

/// The edges of a trigger, which may be in another table of the recording.
pub fn edges_in(
    request: &AttachRequest,
    recording: &Recording,
    column: &str,
    threshold: Option<f64>,
    falling: bool,
) -> Result<TriggerEdges, AttachError> {
    let Some(table) = recording.tables.iter().find(|table| table.column(column).is_some()) else {
        let names: Vec<String> = recording.tables.iter().map(SourceTable::names).collect();
        let is_unusable = |table: &&SourceTable| table.unusable.iter().any(|(name, _)| name == column);
        let unusable = recording.tables.iter().find(is_unusable);
        let found = unusable.map_or_else(
            || format!("no column {column:?}"),
            |table| format!("{} {}", table.name, table.why_not(column)),
        );
        return Err(request.unexpected(found, format!("one of {}", names.join(", "))));
    };
    let values = table.column(column).unwrap_or_default();
    let times_s = times(request, table)?;
    finite(request, table, column, values)?;
    let threshold = threshold.unwrap_or_else(|| trigger::middle(values));
    Ok(TriggerEdges {
        times_s: trigger::edges(&times_s, values, threshold, falling),
        rest_on_other_side: trigger::rest_on_other_side(values, threshold, falling),
    })
}
