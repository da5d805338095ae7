//! Whether the wrist resists the ramp.

use super::contradiction::Contradiction;
use super::measured_trial::MeasuredTrial;
use super::ramp::rounded;
use super::signal_check::SignalCheck;

/// The work of a trial counts as negative beyond what this many standard deviations of the torque before the ramp could do.
const WORK_STANDARD_DEVIATIONS: f64 = 3.0;

/// Ramps in which the motor gains energy from the wrist.
///
/// A wrist stores and dissipates energy: the work of a ramp, beyond that against the torque before it, is positive whichever way
/// it turns, with any inertia, damping and stiffness. A single trial can be otherwise if the subject lets go; most cannot.
pub fn check_resistance(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let gains = |trial: &&MeasuredTrial| {
        trial.work_j < -WORK_STANDARD_DEVIATIONS * trial.unsteadiness_nm * trial.way_rad
    };
    let off: Vec<&MeasuredTrial> = trials.iter().filter(gains).collect();
    if 2 * off.len() <= trials.len() {
        return None;
    }
    let first = off[0];
    Some(Contradiction {
        check: SignalCheck::Resistance,
        place: "columns theta_m_rad and torque_l_nm of the records".into(),
        trials: off.iter().map(|trial| trial.number).collect(),
        measured: format!(
            "the torque helps the ramp: its work is {} J in trial {}",
            rounded(first.work_j),
            first.number
        ),
        stated: "work above 0, since a wrist resists".into(),
        likely_mistake: Some("Is the sign of the torque, or that of the angle, turned?".into()),
        remedy:
            "Turn the sign of the column that is wrong: torque is positive where it resists a positive ramp."
                .into(),
    })
}
