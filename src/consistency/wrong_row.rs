//! Single trials whose record is not that of their row: rows that were exchanged, one record with another sign or unit.
//!
//! The other trials of the session say what a row means. A gauge with an offset, a gain that is off or a torque that nobody holds exactly do
//! the same to all trials, so they are no reason.

use std::collections::BTreeSet;

use super::contradiction::Contradiction;
use super::measured_trial::{MeasuredTrial, median};
use super::ramp::rounded;
use super::signal_check::SignalCheck;
use crate::statistics::SD_BY_MEDIAN;

/// A record is not that of its row if it is beyond this many standard deviations of what rows scatter, and is that of another row, or of its
/// own with the sign turned, if it is within as many of it.
const STANDARD_DEVIATIONS: f64 = 5.0;

/// Trials that state the same, from which on their median holds if one of them is wrong.
const LEVEL_TRIALS: usize = 3;

/// Nor does it matter how little the rows scatter where it is this many times nearer to another row than to its own.
const TIMES_NEARER: f64 = 10.0;

/// A torque this many times that of its row, or this part of it, is in another unit: no subject is so far off, and N cm are farther.
const UNIT_FACTOR: f64 = 5.0;

/// What single trials say against their rows.
pub fn check_rows(trials: &[MeasuredTrial]) -> Vec<Contradiction> {
    let speeds = Levels::of(trials, |trial| (trial.stated_speed_rad_s, trial.speed_rad_s));
    // Ramps of the wrong direction or of a speed that no unit explains are found without the other rows.
    let speed = speeds.contradiction(&[WrongRow::Exchanged], |measured, number| RowMessage {
        check: SignalCheck::RampSpeed,
        column: "velocity_rad_s",
        measured: format!("the ramp of trial {number} has {measured} rad/s"),
        unit: "rad/s",
    });
    let torques = Levels::of(trials, |trial| (trial.stated_torque_nm, trial.hold_nm));
    let kinds = [WrongRow::Exchanged, WrongRow::SignTurned, WrongRow::Unit];
    let torque = torques.contradiction(&kinds, |measured, number| RowMessage {
        check: SignalCheck::SteadyTorque,
        column: "torque_nm",
        measured: format!("the torque before the ramp of trial {number} is {measured} N m"),
        unit: "N m",
    });
    speed.into_iter().chain(torque).collect()
}

/// What a message says of a quantity.
struct RowMessage {
    check: SignalCheck,
    column: &'static str,
    measured: String,
    unit: &'static str,
}

/// How a record is not that of its row.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum WrongRow {
    /// It is that of another row.
    Exchanged,
    /// It is that of its own row with the sign turned.
    SignTurned,
    /// It is many times as large, or as small.
    Unit,
}

/// A trial that is measured, in its level.
struct InLevel<'a> {
    trial: &'a MeasuredTrial,
    measured: f64,
    /// Middle of the trials that state the same.
    middle: f64,
    /// Whether the trial counts for that middle.
    is_of_level: bool,
}

/// What was measured in trials, by what they state.
struct Levels<'a> {
    trials: Vec<InLevel<'a>>,
    /// Standard deviation about the middles, from the median of the deviations.
    sd: f64,
}

impl<'a> Levels<'a> {
    /// `value` gives what a trial states and what was measured. Ramps to either side are levels of their own.
    fn of(trials: &'a [MeasuredTrial], value: impl Fn(&MeasuredTrial) -> (f64, f64)) -> Self {
        let side = |trial: &MeasuredTrial| trial.stated_speed_rad_s > 0.0;
        let in_level = |trial: &'a MeasuredTrial| {
            let (stated, measured) = value(trial);
            let alike = trials.iter().filter(|other| side(other) == side(trial) && value(other).0 == stated);
            let all: Vec<f64> = alike.map(|other| value(other).1).collect();
            let of_stated_sign: Vec<f64> = all.iter().copied().filter(|own| own * stated > 0.0).collect();
            // A gauge with an offset may turn the sign of most.
            let level = if 2 * of_stated_sign.len() >= all.len() { &of_stated_sign } else { &all };
            let (middle, is_of_level) = (median(level), level.contains(&measured));
            (all.len() >= LEVEL_TRIALS).then_some(InLevel { trial, measured, middle, is_of_level })
        };
        let trials: Vec<InLevel> = trials.iter().filter_map(in_level).collect();
        let of_level = || trials.iter().filter(|own| own.is_of_level);
        let mut off: Vec<f64> = of_level().map(|own| (own.measured - own.middle).abs()).collect();
        off.sort_by(f64::total_cmp);
        // The trial in the middle of a level says nothing of the scatter.
        let levels: BTreeSet<u64> = of_level().map(|own| own.middle.to_bits()).collect();
        let sd = SD_BY_MEDIAN * median(&off[levels.len().min(off.len())..]);
        Self { trials, sd }
    }

    /// One contradiction for all trials that are wrong in the same way as the first that is so in one of the ways `kinds`.
    fn contradiction(
        &self,
        kinds: &[WrongRow],
        say: impl Fn(String, u32) -> RowMessage,
    ) -> Option<Contradiction> {
        let wrong: Vec<(&InLevel, WrongRow)> = self.wrong().collect();
        let (first, kind) = *wrong.iter().find(|(_, kind)| kinds.contains(kind))?;
        let RowMessage { check, column, measured, unit } = say(rounded(first.measured), first.trial.number);
        let likely_mistake = match kind {
            WrongRow::Exchanged => {
                "Other rows have that: is another record in its row, or were rows exchanged?"
            }
            WrongRow::SignTurned => "Is its sign turned?",
            WrongRow::Unit => "Is it in another unit, or did the gauge fail?",
        };
        Some(Contradiction {
            check,
            place: format!("trials.csv, column {column}"),
            trials: wrong.iter().filter(|(_, own)| *own == kind).map(|(own, _)| own.trial.number).collect(),
            measured,
            stated: format!("{} {unit}, as in the other trials of its row", rounded(first.middle)),
            likely_mistake: Some(likely_mistake.into()),
            remedy: format!("Correct {column} or file, or set the status of the trial to rejected."),
        })
    }

    /// The trials whose record is not that of their row.
    fn wrong(&self) -> impl Iterator<Item = (&InLevel<'a>, WrongRow)> {
        let within = STANDARD_DEVIATIONS * self.sd;
        self.trials.iter().filter_map(move |own| {
            let off = (own.measured - own.middle).abs();
            if off <= within {
                return None;
            }
            // Rows whose scatters overlap tell nothing of a single trial.
            let is_at = |middle: f64| {
                let distance = (middle - own.middle).abs();
                (own.measured - middle).abs() <= within.max(off / TIMES_NEARER) && distance > 2.0 * within
            };
            let wrong = if self.trials.iter().any(|other| is_at(other.middle)) {
                WrongRow::Exchanged
            } else if is_at(-own.middle) {
                WrongRow::SignTurned
            } else if off > (UNIT_FACTOR - 1.0) * own.middle.abs()
                || own.measured.abs() < own.middle.abs() / UNIT_FACTOR
            {
                WrongRow::Unit
            } else {
                return None;
            };
            Some((own, wrong))
        })
    }
}
