//! What no limb can do, and the unit that would explain it: a session of wrong units can be fitted, and some of its numbers look good.

use super::error::ImportError;
use super::mapped_signal::{MappedSignal, SignalUnit};
use super::mapping::Mapping;
use super::source_table::SourceTable;
use crate::consistency::first_repeated;
use crate::dataset::Trial;
use crate::statistics::upper_median;

/// No joint is turned farther by a ramp than this, rad.
const LARGEST_RAMP_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// No wrist and no ankle makes or bears this torque in an experiment, N m.
const LARGEST_TORQUE_NM: f64 = 300.0;

/// Units of angles and of torques that a recording may be in, the most common first.
const LIKELY_ANGLE_UNITS: [SignalUnit; 2] = [SignalUnit::Degree, SignalUnit::Milliradian];
const LIKELY_TORQUE_UNITS: [SignalUnit; 3] =
    [SignalUnit::NewtonMillimetre, SignalUnit::NewtonCentimetre, SignalUnit::PoundInch];

/// A trial is in another unit if its angle or torque is this many times as large as that of the others. The nearest units are a degree and a
/// radian, with a factor of 57.
const OTHER_UNIT: f64 = 50.0;

/// Refuses ramps and torques beyond what a limb can do, with the unit that would make them possible, and a trial of `sources` in another
/// unit than the others.
pub fn check_units(trials: &[Trial], sources: &[String], mapping: &Mapping) -> Result<(), ImportError> {
    let range = |values: &[f64]| {
        let (least, most) = values
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), value| (a.min(*value), b.max(*value)));
        most - least
    };
    let middle = |of: &[f64]| upper_median(of.iter().copied()).unwrap_or(0.0);
    let ramps: Vec<f64> = trials.iter().map(|trial| range(&trial.record.theta_m_rad)).collect();
    let largest =
        |trial: &Trial| trial.record.torque_l_nm.iter().fold(0.0, |most: f64, own| most.max(own.abs()));
    let torques: Vec<f64> = trials.iter().map(largest).collect();
    let (angle_rad, torque_nm) = (middle(&ramps), middle(&torques));
    let columns = &mapping.columns;
    if angle_rad > LARGEST_RAMP_RAD {
        let what = format!("the ramps turn the joint by {angle_rad:.3} rad, half a trial's or more");
        return Err(impossible(
            "angle",
            &columns.angle,
            &what,
            angle_rad / LARGEST_RAMP_RAD,
            &LIKELY_ANGLE_UNITS,
        ));
    }
    if torque_nm > LARGEST_TORQUE_NM {
        let what = format!("the torque is up to {torque_nm:.1} N m in half of the trials or more");
        return Err(impossible(
            "torque",
            &columns.torque,
            &what,
            torque_nm / LARGEST_TORQUE_NM,
            &LIKELY_TORQUE_UNITS,
        ));
    }
    let other = |what: &str, at: usize, times: f64| {
        Err(ImportError::Implausible {
            reason: format!(
                "{}: its {what} is {times:.3} times that of the other trials: is this file in another unit? Convert it, or take it out",
                sources[at]
            ),
        })
    };
    // A ramp that is 50 times smaller than the others was left out before, as none.
    if let Some(at) = ramps.iter().position(|own| *own > OTHER_UNIT * angle_rad) {
        return other("ramp", at, ramps[at] / angle_rad);
    }
    let held: Vec<f64> = trials.iter().map(|trial| held_nm(&trial.record.torque_l_nm)).collect();
    let usual_nm = middle(&held);
    match held.iter().position(|own| *own > OTHER_UNIT * usual_nm) {
        Some(at) => other("torque", at, held[at] / usual_nm),
        None => Ok(()),
    }
}

/// What the torque of a record reaches in a twentieth of its samples, N m: a spike is no unit, and a relaxed wrist resists its ramp.
fn held_nm(torque_nm: &[f64]) -> f64 {
    let mut sizes: Vec<f64> = torque_nm.iter().map(|own| own.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    sizes.get(sizes.len() * 19 / 20).copied().unwrap_or(0.0)
}

/// A quantity that is `times` as large as it can be.
fn impossible(
    role: &str,
    signal: &MappedSignal,
    what: &str,
    times: f64,
    units: &[SignalUnit],
) -> ImportError {
    let factor = signal.unit.factor();
    let explains = |unit: &&SignalUnit| unit.factor() / factor * times <= 1.0;
    let possible: Vec<String> = units.iter().filter(explains).map(|unit| unit.name()).collect();
    let hint = match possible.as_slice() {
        [] => format!("name the right column in columns.{role}, or write its unit there"),
        [unit] => {
            format!("is it another column, or is its unit {unit}? Write the right one in columns.{role}")
        }
        units => format!(
            "is it another column, or is its unit one of {}? Look it up, and write the right one in columns.{role}",
            units.join(", ")
        ),
    };
    ImportError::Implausible {
        reason: format!(
            "column {:?} in {}: {what}; no limb does that: {hint}",
            signal.column,
            signal.unit.name()
        ),
    }
}

/// Refuses a column that is mapped to two signals, and two columns that are equal in every sample of every table.
pub fn check_distinct(tables: &[SourceTable], mapping: &Mapping) -> Result<(), ImportError> {
    let columns = &mapping.columns;
    let signals: Vec<(&str, &MappedSignal)> = [
        ("angle", Some(&columns.angle)),
        ("torque", Some(&columns.torque)),
        ("emg_fcr", columns.emg_fcr.as_ref()),
        ("emg_ecr", columns.emg_ecr.as_ref()),
        ("handle_angle", columns.handle_angle.as_ref()),
        ("handle_acceleration", columns.handle_acceleration.as_ref()),
        ("hand_torque", columns.hand_torque.as_ref()),
        ("joint_angle", columns.joint_angle.as_ref()),
    ]
    .into_iter()
    .filter_map(|(role, signal)| Some((role, signal?)))
    .collect();
    for (at, (role, own)) in signals.iter().enumerate() {
        for (other_role, other) in &signals[at + 1..] {
            let are_equal = || {
                !tables.is_empty()
                    && tables.iter().all(|table| {
                        let pair = table.column(&own.column).zip(table.column(&other.column));
                        pair.is_some_and(|(own, other)| own == other)
                    })
            };
            let reason = if own.column == other.column {
                format!("columns.{role} and columns.{other_role} are both column {:?}", own.column)
            } else if are_equal() {
                format!(
                    "column {:?} ({role}) and column {:?} ({other_role}) are equal in every sample",
                    own.column, other.column
                )
            } else {
                continue;
            };
            return Err(ImportError::Implausible {
                reason: format!("{reason}; two signals are never equal: name the right columns"),
            });
        }
    }
    Ok(())
}

/// Refuses two records whose angle and torque are equal in every sample: they would count as repetitions that agree perfectly.
pub fn check_own_records(records: &[SourceTable], mapping: &Mapping) -> Result<(), ImportError> {
    let both = [&mapping.columns.angle, &mapping.columns.torque];
    let signals: Vec<[&[f64]; 2]> =
        records.iter().map(|table| both.map(|own| table.column(&own.column).unwrap_or_default())).collect();
    match first_repeated(&signals) {
        Some((first, second)) => Err(ImportError::Implausible {
            reason: format!(
                "{} and {} have the same angle and torque in every sample; noise never comes twice, so that one of them is a copy: remove it",
                records[first].name, records[second].name
            ),
        }),
        None => Ok(()),
    }
}
