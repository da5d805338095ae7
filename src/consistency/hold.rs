//! Torque and angle before the ramps.

use super::contradiction::Contradiction;
use super::likely_mistake;
use super::measured_trial::{MeasuredTrial, mean, median};
use super::ramp::rounded;
use super::signal_check::SignalCheck;

/// Largest factor between measured and stated torque, where torque levels tell it from an offset of the gauge: no calibration
/// is that far off, and units are farther.
const GAIN_FACTOR: f64 = 1.5;

/// Largest factor where there is one torque level, so that an offset of the gauge can be part of it.
const ONE_LEVEL_FACTOR: f64 = 5.0;

/// No joint holds more, N m: strong knees reach some 400.
const LARGEST_NM: f64 = 500.0;

/// Two torques are different levels if they differ by this part of the largest one.
const LEVEL_SPREAD: f64 = 0.2;

/// A gain counts as off if it is beyond the limit by this many standard errors.
const GAIN_STANDARD_ERRORS: f64 = 3.0;

/// No wrist and no ankle bends farther from its middle than this, rad.
const FARTHEST_RAD: f64 = std::f64::consts::FRAC_PI_2;

/// What is wrong with the torque before the ramps.
pub fn check_torque(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let stated = |trial: &MeasuredTrial| trial.stated_torque_nm;
    let largest = trials.iter().map(|trial| stated(trial).abs()).fold(0.0, f64::max);
    let (low, high) = trials
        .iter()
        .map(stated)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (f64::min(low, x), f64::max(high, x)));
    if largest == 0.0 {
        return None;
    }
    let (ratio, is_off) = if high - low > LEVEL_SPREAD * largest && trials.len() > 3 {
        let (gain, se) = gain(trials);
        let beyond = GAIN_STANDARD_ERRORS * se;
        (gain, gain + beyond < 1.0 / GAIN_FACTOR || gain - beyond > GAIN_FACTOR)
    } else {
        let ratios: Vec<f64> =
            trials.iter().filter(|t| stated(t) != 0.0).map(|t| t.hold_nm / stated(t)).collect();
        let ratio = median(&ratios);
        (ratio, !(1.0 / ONE_LEVEL_FACTOR..=ONE_LEVEL_FACTOR).contains(&ratio))
    };
    if !is_off {
        return impossible(trials);
    }
    let first = trials.iter().find(|trial| trial.stated_torque_nm != 0.0)?;
    let likely_mistake = if (-GAIN_FACTOR..=-1.0 / GAIN_FACTOR).contains(&ratio) {
        Some(
            "Is the sign of torque_l_nm turned, or was a left hand recorded as it is on a right one?"
                .to_owned(),
        )
    } else {
        likely_mistake::of_torque(ratio)
    };
    Some(Contradiction {
        check: SignalCheck::SteadyTorque,
        place: "trials.csv, column torque_nm".into(),
        trials: trials.iter().map(|trial| trial.number).collect(),
        measured: format!(
            "the torque before the ramps is {} times as large as stated (trial {}: {} N m)",
            rounded(ratio),
            first.number,
            rounded(first.hold_nm)
        ),
        stated: format!("{} N m in trial {}", rounded(first.stated_torque_nm), first.number),
        likely_mistake,
        remedy: "Give torque_l_nm in N m, positive where it resists a positive ramp.".into(),
    })
}

/// Torques that are as stated, and that no joint holds.
fn impossible(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let sizes: Vec<f64> = trials.iter().map(|trial| trial.hold_nm.abs()).collect();
    let middle = median(&sizes);
    if middle <= LARGEST_NM {
        return None;
    }
    Some(Contradiction {
        check: SignalCheck::SteadyTorque,
        place: "trials.csv, column torque_nm".into(),
        trials: trials.iter().map(|trial| trial.number).collect(),
        measured: format!(
            "the torque before the ramps is {} N m, by the records and by the table",
            rounded(middle)
        ),
        stated: format!("at most {LARGEST_NM} N m, as no joint holds more"),
        likely_mistake: Some("Are torque_l_nm and torque_nm in mN m?".into()),
        remedy: "Give both torques in N m.".into(),
    })
}

/// Slope of the measured over the stated torque, and its standard error: an offset of the gauge is not part of it.
fn gain(trials: &[MeasuredTrial]) -> (f64, f64) {
    let x: Vec<f64> = trials.iter().map(|trial| trial.stated_torque_nm).collect();
    let y: Vec<f64> = trials.iter().map(|trial| trial.hold_nm).collect();
    let (x_mean, y_mean) = (mean(&x), mean(&y));
    let square: f64 = x.iter().map(|x| (x - x_mean) * (x - x_mean)).sum();
    let product: f64 = x.iter().zip(&y).map(|(x, y)| (x - x_mean) * (y - y_mean)).sum();
    let slope = product / square;
    let left = |(x, y): (&f64, &f64)| {
        let left = y - y_mean - slope * (x - x_mean);
        left * left
    };
    let variance = x.iter().zip(&y).map(left).sum::<f64>() / (x.len() - 2) as f64;
    (slope, libm::sqrt(variance / square))
}

/// An angle before the ramps that no joint has.
pub fn check_angle(trials: &[MeasuredTrial]) -> Option<Contradiction> {
    let angles: Vec<f64> = trials.iter().map(|trial| trial.hold_rad).collect();
    let middle = median(&angles);
    if middle.abs() <= FARTHEST_RAD {
        return None;
    }
    Some(Contradiction {
        check: SignalCheck::AngleRange,
        place: "column theta_m_rad of the records".into(),
        trials: trials.iter().map(|trial| trial.number).collect(),
        measured: format!("the motor stands at {} rad before the ramps", rounded(middle)),
        stated: format!("an angle between -{0} and {0} rad, as far as a wrist bends", rounded(FARTHEST_RAD)),
        likely_mistake: Some(
            "Is the angle zeroed elsewhere than at the neutral position of the wrist, or not in rad?".into(),
        ),
        remedy: "Subtract the angle of the neutral position.".into(),
    })
}
