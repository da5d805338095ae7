//! The place of the motion against `onset_s`.

use super::contradiction::Contradiction;
use super::measured_trial::MeasuredTrial;
use super::ramp::rounded;
use super::signal_check::SignalCheck;

/// A motor that moves this long after its onset leaves less than a quarter of the paper's window with a ramp in it, s. Ramps
/// rise over up to 30 ms, of which half count, and motors lag by up to 5 ms.
const LATEST_S: f64 = 0.030;

/// What is wrong with the onsets; `stated_s` has that of each trial, `None` where the analysis finds it.
pub fn check_onsets(
    trials: &[MeasuredTrial],
    stated_s: &[Option<f64>],
    sample_rate_hz: f64,
) -> Vec<Contradiction> {
    let rounding_s = 0.5 / sample_rate_hz;
    let lateness = |of: &dyn Fn(&MeasuredTrial, f64) -> bool| -> Vec<(&MeasuredTrial, f64)> {
        let stated = trials.iter().zip(stated_s).filter_map(|(trial, stated)| Some((trial, (*stated)?)));
        stated.filter(|(trial, onset_s)| of(trial, *onset_s)).collect()
    };
    let late = lateness(&|trial, onset_s| trial.noticed_s + rounding_s < onset_s);
    let early = lateness(&|trial, onset_s| trial.noticed_s - onset_s > LATEST_S);
    [late_onset(&late), early_onset(&early)].into_iter().flatten().collect()
}

fn late_onset(late: &[(&MeasuredTrial, f64)]) -> Option<Contradiction> {
    let (first, onset_s) = late.first()?;
    Some(Contradiction {
        check: SignalCheck::Onset,
        place: "trials.csv, column onset_s".into(),
        trials: late.iter().map(|(trial, _)| trial.number).collect(),
        measured: format!(
            "the motor moves before the onset: trial {} from {} s on",
            first.number,
            rounded(first.motion_s)
        ),
        stated: format!("motion from {onset_s} s on"),
        likely_mistake: Some(format!("Is the onset about {:.0} ms late?", 1e3 * (onset_s - first.motion_s))),
        remedy: remedy(),
    })
}

fn early_onset(early: &[(&MeasuredTrial, f64)]) -> Option<Contradiction> {
    let (first, onset_s) = early.first()?;
    Some(Contradiction {
        check: SignalCheck::Onset,
        place: "trials.csv, column onset_s".into(),
        trials: early.iter().map(|(trial, _)| trial.number).collect(),
        measured: format!(
            "the motor hardly moves in the {:.0} ms after the onset: trial {} from {} s on",
            1e3 * LATEST_S,
            first.number,
            rounded(first.noticed_s)
        ),
        stated: format!("motion from {onset_s} s on"),
        likely_mistake: Some(format!(
            "Is the onset about {:.0} ms early?",
            1e3 * (first.noticed_s - onset_s)
        )),
        remedy: remedy(),
    })
}

fn remedy() -> String {
    "Correct onset_s, or leave it empty: the onset is then found in theta_m_rad.".into()
}
