//! Cutting one long record into trials.

use super::error::ImportError;
use super::mapping::{LongRecord, Mapping};
use super::ramp_way::RampWay;
use super::source_table::SourceTable;

/// The speed of an angle is taken over this time, s.
const SPEED_OVER_S: f64 = 0.008;

/// A motor that moves keeps its speed for this time, s, less than any ramp takes; a sample that is off does not.
const MOVING_FOR_S: f64 = 0.004;

/// A ramp is where the speed is above this part of the largest.
const RAMP_SHARE: f64 = 0.3;

/// Cuts `table` by the column that tells trials apart, if the mapping names one.
pub fn into_trials(table: SourceTable, mapping: &Mapping) -> Result<Vec<SourceTable>, ImportError> {
    match &mapping.trial_column {
        Some(column) => by_column(&table, column),
        None => Ok(vec![table]),
    }
}

/// A record cut at its ramps.
pub struct CutRecord {
    /// The parts, each with a ramp.
    pub parts: Vec<SourceTable>,
    /// Ramps that gave no part, and why.
    pub left_out: Vec<String>,
}

/// Cuts `table` at its ramps, if the mapping says that it is one long record.
pub fn at_ramps(table: SourceTable, mapping: &Mapping, rate_hz: f64) -> Result<CutRecord, ImportError> {
    match &mapping.long_record {
        Some(long) => by_ramps(&table, mapping, long, rate_hz),
        None => Ok(CutRecord { parts: vec![table], left_out: Vec::new() }),
    }
}

fn by_column(table: &SourceTable, column: &str) -> Result<Vec<SourceTable>, ImportError> {
    let values = needed(table, column, "the number of the trial")?;
    let mut first = 0;
    Ok(values
        .chunk_by(|a, b| a == b)
        .map(|run| {
            let part = part(table, first, first + run.len(), &format!("{column} {}", run[0]));
            first += run.len();
            part
        })
        .collect())
}

fn by_ramps(
    table: &SourceTable,
    mapping: &Mapping,
    long: &LongRecord,
    rate_hz: f64,
) -> Result<CutRecord, ImportError> {
    let angle = needed(table, &mapping.columns.angle.column, "the angle")?;
    let starts = match &long.ramp_column {
        Some(column) => rises(needed(table, column, "the signal of the ramps")?, long.threshold),
        None => fast_starts(angle, rate_hz),
    };
    let samples = table.columns.first().map_or(0, |(_, values)| values.len());
    let [before, after] = [long.before_s, long.after_s].map(|time_s| libm::round(time_s * rate_hz) as usize);
    let (mut parts, mut left_out) = (Vec::new(), Vec::new());
    let (mut ways, mut seen) = (Vec::new(), Vec::new());
    let mut free = 0;
    for start in starts {
        // A ramp within the last trial is its return, not a trial of its own.
        if start < free {
            continue;
        }
        seen.push(start.saturating_sub(before)..start + after);
        let sides =
            [(start, before, "before", long.before_s), (samples - start, after, "after", long.after_s)];
        if let Some((there, _, side, wanted_s)) = sides.into_iter().find(|(there, wanted, ..)| there < wanted)
        {
            left_out.push(format!(
                "{}: the ramp at {:.3} s has {:.3} s {side} it; expected long_record.{side}_s ({wanted_s} s)",
                table.name,
                start as f64 / rate_hz,
                there as f64 / rate_hz,
            ));
            continue;
        }
        ways.push(RampWay::of(&angle[start..start + after], angle[start]));
        parts.push(part(table, start - before, start + after, &format!("ramp {}", parts.len() + 1)));
        free = start + after;
    }
    if parts.is_empty() {
        let reason = format!(
            "{}: no ramp with {} s before and {} s after it; shorten long_record.before_s and after_s, or correct ramp_column and \
             threshold",
            table.name, long.before_s, long.after_s
        );
        return Err(ImportError::NoTrial { reason });
    }
    let taken = RampWay::median(&ways).map_or_else(Vec::new, |way| way.taken_in(angle));
    let unseen = taken.iter().filter(|(_, gone_at)| !seen.iter().any(|own| own.contains(gone_at)));
    let why = match &long.ramp_column {
        Some(column) => {
            format!("where {column} does not rise through long_record.threshold ({})", long.threshold)
        }
        None => format!(
            "slower than {RAMP_SHARE} times the fastest; name a signal of the ramps in long_record.ramp_column"
        ),
    };
    left_out.extend(unseen.map(|(left_at, _)| {
        let time_s = *left_at as f64 / rate_hz;
        format!("{}: the motor goes the way of the ramps after {time_s:.3} s, {why}", table.name)
    }));
    Ok(CutRecord { parts, left_out })
}

/// Samples at which the angle becomes fast beside the fastest ramp.
fn fast_starts(angle: &[f64], rate_hz: f64) -> Vec<usize> {
    let speed = kept_speed(angle, rate_hz);
    let largest = speed.iter().copied().fold(0.0, f64::max);
    rises(&speed, RAMP_SHARE * largest)
}

/// Angle made good in [`SPEED_OVER_S`], without its sign, the least of those that begin within [`MOVING_FOR_S`].
fn kept_speed(angle: &[f64], rate_hz: f64) -> Vec<f64> {
    let samples = |time_s: f64| (libm::round(time_s * rate_hz) as usize).max(1);
    let span = samples(SPEED_OVER_S);
    let speed: Vec<f64> = angle.windows(span + 1).map(|own| (own[span] - own[0]).abs()).collect();
    let least = |own: &[f64]| own.iter().copied().fold(f64::INFINITY, f64::min);
    speed.windows(samples(MOVING_FOR_S) + 1).map(least).collect()
}

/// Samples at which `values` rise through `threshold`.
fn rises(values: &[f64], threshold: f64) -> Vec<usize> {
    let rises = values.windows(2).enumerate().filter(|(_, pair)| pair[0] <= threshold && pair[1] > threshold);
    rises.map(|(sample, _)| sample + 1).collect()
}

fn needed<'a>(table: &'a SourceTable, column: &str, role: &'static str) -> Result<&'a [f64], ImportError> {
    table.column(column).ok_or_else(|| ImportError::NoColumn {
        table: table.name.clone(),
        why: table.why_not(column),
        role,
        columns: table.names(),
    })
}

fn part(table: &SourceTable, from: usize, to: usize, name: &str) -> SourceTable {
    let columns =
        table.columns.iter().map(|(name, values)| (name.clone(), values[from..to].to_vec())).collect();
    SourceTable {
        name: format!("{}, {name}", table.name),
        columns,
        unusable: table.unusable.clone(),
        stated: table.stated.clone(),
    }
}
