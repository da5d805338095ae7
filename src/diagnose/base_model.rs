//! Whether the model as given describes a session at all: where it does not, its misfit says nothing about causes.

use crate::fit::{
    Fit, NoSessionModel, Observations, Termination, TrialObservation, coarse_angle, predictions,
    variance_accounted_for,
};
use crate::statistics::upper_median;

/// Smallest part of the torque's variance that the model must account for in the median trial. The paper's fits are above 0.9; below one
/// half, most of what is fitted is something else.
const LEAST_VAF: f64 = 0.5;

/// The recorded ramps are at most this many times faster or slower than the session states: no servo and no gain is off by a factor of
/// two, but a unit is.
const SPEED_FACTOR: f64 = 2.0;

/// Largest variance of the torque error from averaged angles, beside that of the torque's noise. Of sound sessions on encoders of 13 and
/// 14 bits, 3 of 5 below it and 1 of 10 above it were adequate (decision 29). Where motions are known between the steps, what is a trial's own
/// is far below it.
pub const UNTRUSTED_ANGLE_ERROR: f64 = 8.0;

/// Why no cause can be looked for in the misfit of `fit`; `None` if the model describes the session.
pub fn not_described(observations: &Observations, fit: &Fit) -> Option<String> {
    let ratio = upper_median(speed_ratios(observations)).unwrap_or(f64::NAN);
    if !(1.0 / SPEED_FACTOR..SPEED_FACTOR).contains(&ratio) {
        let likely = if (ratio - 1f64.to_degrees()).abs() < 0.1 * ratio { ": degrees?" } else { "" };
        return Some(format!(
            "the ramps turn {ratio:.3} times as fast as velocity_rad_s says{likely}; check the units of the angle, of the time and of \
             the table"
        ));
    }
    if let Some(reason @ NoSessionModel::CoarseAngle { ratio, .. }) = coarse_angle(observations, fit)
        && ratio > UNTRUSTED_ANGLE_ERROR
    {
        return Some(reason.to_string());
    }
    let is_lost = |outcome: &_| matches!(outcome, Termination::NotFinite | Termination::Iterations);
    if !fit.cost().is_finite() || fit.solution.outcomes.iter().any(|own| is_lost(&own.termination)) {
        return Some("the fit of the model did not arrive at an optimum".into());
    }
    if fit.residual_covariances.is_empty() {
        return Some("no noise could be measured, neither in holds nor between repetitions".into());
    }
    let vafs =
        predictions(observations, fit).into_iter().zip(&observations.trials).map(|(prediction, trial)| {
            let [measured, residual] =
                [&trial.measured_nm, &prediction.residual_nm].map(|own| observations.torque_of(own));
            variance_accounted_for(measured, residual)
        });
    let vaf = upper_median(vafs).unwrap_or(f64::NAN);
    (vaf < LEAST_VAF || vaf.is_nan()).then(|| {
        format!(
            "the model accounts for {:.0} % of the torque's variance, so it does not describe these data; check signs, units and onsets",
            100.0 * vaf
        )
    })
}

/// For each trial, the largest speed of the motor in the window as a part of that in the session's table.
fn speed_ratios(observations: &Observations) -> Vec<f64> {
    let of_trial = |trial: &TrialObservation| {
        let window = &trial.input.motion[trial.input.onset..];
        let fastest =
            window.iter().take(observations.samples).map(|knot| knot.omega.abs()).fold(0.0, f64::max);
        fastest / trial.velocity_rad_s.abs()
    };
    observations.trials.iter().map(of_trial).collect()
}
