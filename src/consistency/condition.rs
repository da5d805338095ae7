//! Labels of conditions against the velocities and torques of their trials.

use super::contradiction::Contradiction;
use super::signal_check::SignalCheck;
use crate::dataset::Trial;

/// A label that trials of several velocities or torques have: they would be fitted and averaged as one condition.
pub fn check_conditions(trials: &[&Trial]) -> Option<Contradiction> {
    let stated = |trial: &Trial| (trial.velocity_rad_s, trial.torque_nm);
    let mut off: Vec<(&Trial, &Trial)> = Vec::new();
    for trial in trials.iter().filter(|trial| trial.condition.is_some()) {
        let first = trials.iter().find(|other| other.condition == trial.condition)?;
        if stated(first) != stated(trial) {
            off.push((first, trial));
        }
    }
    let (first, other) = off.first()?;
    let said = |trial: &Trial| format!("{} rad/s and {} N m", trial.velocity_rad_s, trial.torque_nm);
    Some(Contradiction {
        check: SignalCheck::Condition,
        place: "trials.csv, column condition".into(),
        trials: off.iter().map(|(_, other)| other.number).collect(),
        measured: format!(
            "{:?} is a condition of {} in trial {} and of {} in trial {}",
            first.condition.as_deref().unwrap_or_default(),
            said(first),
            first.number,
            said(other),
            other.number
        ),
        stated: "one velocity and one torque for each condition".into(),
        likely_mistake: Some("Does the column say something else, such as a group or a session?".into()),
        remedy: "Give each condition its own label, or rename the column.".into(),
    })
}
