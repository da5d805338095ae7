//! Speed and direction of the ramps against `velocity_rad_s`.

use super::contradiction::Contradiction;
use super::likely_mistake;
use super::measured_trial::{MeasuredTrial, median};
use super::signal_check::SignalCheck;

/// Column of the speeds.
const PLACE: &str = "trials.csv, column velocity_rad_s";

/// Largest factor between the measured and the stated speed in the median of a session. A motor that lags, a short ramp or an
/// angle gain that is off give at most a third; units give more than this.
const SESSION_FACTOR: f64 = 1.5;

/// No joint is stretched faster, rad/s: studies of reflexes go to some 10 rad/s. In degrees a second the slowest ramps are above it.
const FASTEST_RAD_S: f64 = 30.0;

/// Largest factor between the measured and the stated speed of one trial.
const TRIAL_FACTOR: f64 = 2.5;

/// Stated speeds that differ by less than this factor count as one speed.
const DISTINCT_FACTOR: f64 = 1.25;

/// What is wrong with the speeds and directions of the ramps.
pub fn check_ramps(trials: &[MeasuredTrial]) -> Vec<Contradiction> {
    let ratios: Vec<f64> = trials.iter().map(|trial| trial.speed_ratio().abs()).collect();
    let middle = median(&ratios);
    let beyond = |factor: f64, ratio: f64| libm::log(ratio).abs() > libm::log(factor);
    let speed = if beyond(SESSION_FACTOR, middle) {
        Some(of_session(trials, middle))
    } else if let Some(impossible) = impossible(trials) {
        Some(impossible)
    } else {
        let off: Vec<&MeasuredTrial> =
            trials.iter().filter(|trial| beyond(TRIAL_FACTOR, trial.speed_ratio().abs())).collect();
        if off.is_empty() { of_rows(trials, middle) } else { Some(of_some(&off)) }
    };
    speed.into_iter().chain(direction(trials)).collect()
}

/// No ramp stands out of the noise of the angle in the trials `still`.
pub fn no_ramps(still: Vec<u32>) -> Contradiction {
    Contradiction {
        check: SignalCheck::RampSpeed,
        place: PLACE.into(),
        trials: still,
        measured: "no ramp stands out of the noise of theta_m_rad".into(),
        stated: "a ramp".into(),
        likely_mistake: Some("Does the column hold another signal?".into()),
        remedy: "Give the angle of the motor in rad.".into(),
    }
}

/// Speeds that are as stated, and that no joint is stretched with.
fn impossible(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let speeds: Vec<f64> = trials.iter().map(|trial| trial.speed_rad_s.abs()).collect();
    let middle = median(&speeds);
    if middle <= FASTEST_RAD_S {
        return None;
    }
    Some(Contradiction {
        check: SignalCheck::RampSpeed,
        place: PLACE.into(),
        trials: trials.iter().map(|trial| trial.number).collect(),
        measured: format!("the ramps have {} rad/s, by the records and by the table", rounded(middle)),
        stated: format!("at most {FASTEST_RAD_S} rad/s, as no joint is stretched faster"),
        likely_mistake: Some(
            "Are theta_m_rad and velocity_rad_s in degrees, or t_s in milliseconds and velocity_rad_s in rad/ms?".into(),
        ),
        remedy: "Give theta_m_rad in rad, t_s in s and velocity_rad_s in rad/s.".into(),
    })
}

/// All speeds are off by the same factor.
fn of_session(trials: &[MeasuredTrial], ratio: f64) -> Contradiction {
    let first = &trials[0];
    Contradiction {
        check: SignalCheck::RampSpeed,
        place: PLACE.into(),
        trials: trials.iter().map(|trial| trial.number).collect(),
        measured: format!(
            "the ramps are {} times as fast as stated (trial {}: {} rad/s)",
            rounded(ratio),
            first.number,
            rounded(first.speed_rad_s.abs())
        ),
        stated: format!("{} rad/s in trial {}", first.stated_speed_rad_s.abs(), first.number),
        likely_mistake: restart(trials).or_else(|| likely_mistake::of_speed(ratio)),
        remedy: "Give theta_m_rad in rad without restarts, t_s in s and velocity_rad_s in rad/s.".into(),
    }
}

/// An encoder of one of the trials that starts anew at the end of its turn.
fn restart<'a>(trials: impl IntoIterator<Item = &'a MeasuredTrial>) -> Option<String> {
    trials.into_iter().find_map(|trial| likely_mistake::of_step(trial.largest_step_rad))
}

/// Some trials have another speed than stated.
fn of_some(off: &[&MeasuredTrial]) -> Contradiction {
    let first = off[0];
    Contradiction {
        check: SignalCheck::RampSpeed,
        place: PLACE.into(),
        trials: off.iter().map(|trial| trial.number).collect(),
        measured: format!(
            "the ramp of trial {} has {} rad/s",
            first.number,
            rounded(first.speed_rad_s.abs())
        ),
        stated: format!("{} rad/s", first.stated_speed_rad_s.abs()),
        likely_mistake: restart(off.iter().copied())
            .or_else(|| Some("Is another record in its row, or did the motor stop?".into())),
        remedy: "Correct velocity_rad_s or file, or set the status of the trial to rejected.".into(),
    }
}

/// The speeds are those of the table, but most trials have that of another row.
fn of_rows(trials: &[MeasuredTrial], middle: f64) -> Option<Contradiction> {
    let distance = |a: f64, b: f64| libm::log(a.abs() / b.abs()).abs();
    let belongs_elsewhere = |trial: &&MeasuredTrial| {
        let measured = trial.speed_rad_s / middle;
        let own = distance(measured, trial.stated_speed_rad_s);
        trials.iter().any(|other| {
            distance(other.stated_speed_rad_s, trial.stated_speed_rad_s) > libm::log(DISTINCT_FACTOR)
                && distance(measured, other.stated_speed_rad_s) < own
        })
    };
    let off: Vec<&MeasuredTrial> = trials.iter().filter(belongs_elsewhere).collect();
    // Random rows leave most trials with another speed, an honest session almost none.
    if 3 * off.len() <= trials.len() {
        return None;
    }
    Some(Contradiction {
        likely_mistake: Some(
            "The speeds are those of other rows: are the rows in another order than the records?".into(),
        ),
        remedy: "Correct the columns file and velocity_rad_s.".into(),
        ..of_some(&off)
    })
}

/// Ramps that go the other way than stated.
fn direction(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let off: Vec<&MeasuredTrial> = trials.iter().filter(|trial| trial.speed_ratio() < 0.0).collect();
    let first = off.first()?;
    let says = if off.len() == trials.len() {
        "Is the sign of theta_m_rad turned, or was a left hand recorded as it is on a right one?"
    } else {
        "Do these rows have the wrong sign, or another record?"
    };
    Some(Contradiction {
        check: SignalCheck::RampDirection,
        place: PLACE.into(),
        trials: off.iter().map(|trial| trial.number).collect(),
        measured: format!(
            "the ramp of trial {} goes with {} rad/s",
            first.number,
            rounded(first.speed_rad_s)
        ),
        stated: format!("{} rad/s", first.stated_speed_rad_s),
        likely_mistake: Some(says.into()),
        remedy: "Turn the sign of the angle, or of velocity_rad_s if the motor did turn that way.".into(),
    })
}

/// A number with three digits.
pub fn rounded(value: f64) -> String {
    crate::protocol::significant(value)
}
