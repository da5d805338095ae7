//! Trials whose row states no torque: a relaxed wrist, or a cell that nobody filled in.

use super::contradiction::Contradiction;
use super::measured_trial::{MeasuredTrial, median};
use super::ramp::rounded;
use super::signal_check::SignalCheck;
use crate::statistics::SD_BY_MEDIAN;

/// A wrist that is relaxed holds no more, N m: the weight of a hand is some 4 N, 7 cm from the wrist.
const RELAXED_NM: f64 = 0.5;

/// The torque of a row that states 0 is nearer to that of a row that states more than to 0 from this part of the difference on.
const NEARER: f64 = 0.5;

/// A difference counts if it is this many standard deviations of what trials of one row scatter.
const STANDARD_DEVIATIONS: f64 = 5.0;

/// What `trials` that state a torque of 0 show instead. An offset of the gauge is part of all trials: where others state a torque, only the
/// difference to them counts.
pub fn check_zero(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let of_zero: Vec<&MeasuredTrial> = trials.iter().filter(|trial| trial.stated_torque_nm == 0.0).collect();
    if of_zero.is_empty() {
        return None;
    }
    let stated = trials.iter().map(|trial| trial.stated_torque_nm).filter(|torque_nm| *torque_nm != 0.0);
    let found: Vec<&MeasuredTrial> = match stated.min_by(|a, b| a.abs().total_cmp(&b.abs())) {
        None => {
            let holds: Vec<f64> = of_zero.iter().map(|trial| trial.hold_nm.abs()).collect();
            if median(&holds) <= RELAXED_NM { Vec::new() } else { of_zero }
        }
        Some(level_nm) => as_if_of_level(trials, of_zero, level_nm),
    };
    let worst = found.iter().max_by(|a, b| a.hold_nm.abs().total_cmp(&b.hold_nm.abs()))?;
    Some(Contradiction {
        check: SignalCheck::SteadyTorque,
        place: "trials.csv, column torque_nm".into(),
        trials: found.iter().map(|trial| trial.number).collect(),
        measured: format!("the torque before the ramp of trial {} is {} N m", worst.number, rounded(worst.hold_nm)),
        stated: "0 N m, which says that the wrist is relaxed".into(),
        likely_mistake: Some("Was the column not filled in, or has the gauge an offset?".into()),
        remedy: "Give the torque that the subject was asked to hold, and take the offset of the gauge off torque_l_nm.".into(),
    })
}

/// Those of the trials `of_zero` whose torque is that of the trials that state `level_nm`, rather than less by as much.
fn as_if_of_level<'a>(
    trials: &[MeasuredTrial],
    of_zero: Vec<&'a MeasuredTrial>,
    level_nm: f64,
) -> Vec<&'a MeasuredTrial> {
    let of_level: Vec<f64> =
        trials.iter().filter(|trial| trial.stated_torque_nm == level_nm).map(|trial| trial.hold_nm).collect();
    let middle = median(&of_level);
    let deviations: Vec<f64> = of_level.iter().map(|hold| (hold - middle).abs()).collect();
    if STANDARD_DEVIATIONS * SD_BY_MEDIAN * median(&deviations) > NEARER * level_nm.abs() {
        return Vec::new();
    }
    let part = |trial: &MeasuredTrial| 1.0 + (trial.hold_nm - middle) / level_nm;
    of_zero.into_iter().filter(|trial| part(trial) > NEARER).collect()
}
