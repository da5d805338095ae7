//! Conditions and covariates of the trials: what trial-level mechanisms depend on.

use super::hold_noise::HOLD_S;
use super::observations::{EmgGaps, TrialObservation, mean};
use crate::dataset::Trial;
use crate::wrist::mechanisms::Covariates;

/// Numbers the conditions of `trials` by label, or by velocity and torque if the session has no labels.
pub fn number_conditions(trials: &mut [TrialObservation]) {
    let key = |trial: &TrialObservation| match &trial.label {
        Some(label) => (0.0, 0.0, label.clone()),
        None => (trial.velocity_rad_s, trial.torque_nm, String::new()),
    };
    let mut keys: Vec<_> = trials.iter().map(key).collect();
    keys.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)).then(a.2.cmp(&b.2)));
    keys.dedup();
    for trial in trials {
        let own = key(trial);
        trial.condition = keys.iter().position(|other| *other == own).unwrap_or(0);
    }
}

/// The rest before a trial, s; `None` if the session does not say.
fn rest_s(trial: &Trial) -> Option<f64> {
    trial.extra.get("rest_s").and_then(|text| text.parse().ok())
}

/// Sets the covariates of `trials`: velocity, torque before the ramp, position in the session, rest, and EMG during the hold.
/// `usable` are the trials of the session in run order. A session that leaves out the rest of a single trial has none, and one that leaves
/// out an EMG channel of a single one of `trials` has no such channel.
pub fn set_covariates(trials: &mut [TrialObservation], usable: &[&Trial], period_s: f64) -> EmgGaps {
    let last = usable.len().max(2) as f64 - 1.0;
    let rests: Option<Vec<f64>> = usable.iter().map(|source| rest_s(source)).collect();
    let mut emg = Vec::new();
    for trial in trials.iter_mut() {
        let Some(position) = usable.iter().position(|source| source.number == trial.number) else {
            continue;
        };
        let source = usable[position];
        let hold_end = libm::round((trial.onset_s - source.record.start_s) / period_s) as usize;
        let longest = libm::round(HOLD_S / period_s) as usize;
        // Raw EMG has mean zero at any activation, so it is rectified; an envelope is not changed by that.
        let mean_in_hold = |channel: &Option<Vec<f64>>| {
            channel.as_ref().map(|channel| {
                let hold = &channel[hold_end.saturating_sub(longest)..hold_end];
                mean(&hold.iter().map(|emg| emg.abs()).collect::<Vec<_>>())
            })
        };
        emg.push((
            trial.torque_nm,
            mean_in_hold(&source.record.emg_fcr_mvc),
            mean_in_hold(&source.record.emg_ecr_mvc),
        ));
        trial.input.covariates = Covariates {
            velocity_rad_s: trial.velocity_rad_s.abs(),
            torque_before_nm: trial.direction * trial.torque_0_nm,
            progress: position as f64 / last,
            rest_s: rests.as_ref().map_or(0.0, |rests| rests[position]),
            flexor_emg_excess_mvc: 0.0,
            extensor_emg_mvc: 0.0,
        };
    }
    let flexor: Option<Vec<f64>> = emg.iter().map(|(_, flexor, _)| *flexor).collect();
    let extensor: Option<Vec<f64>> = emg.iter().map(|(_, _, extensor)| *extensor).collect();
    for (place, (trial, (torque, ..))) in trials.iter_mut().zip(&emg).enumerate() {
        if let Some(flexor) = &flexor {
            let at_same_torque = emg.iter().zip(flexor).filter(|((other, ..), _)| other == torque);
            let same_torque: Vec<f64> = at_same_torque.map(|(_, level)| *level).collect();
            trial.input.covariates.flexor_emg_excess_mvc = flexor[place] - mean(&same_torque);
        }
        trial.input.covariates.extensor_emg_mvc = extensor.as_ref().map_or(0.0, |levels| levels[place]);
    }
    let gaps = |with: usize| if with == 0 { 0 } else { emg.len() - with };
    EmgGaps {
        without_flexor: gaps(emg.iter().filter(|(_, flexor, _)| flexor.is_some()).count()),
        without_extensor: gaps(emg.iter().filter(|(_, _, extensor)| extensor.is_some()).count()),
        of: emg.len(),
    }
}
