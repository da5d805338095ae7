//! All checks of a session.

use super::contradiction::{Contradiction, Contradictions};
use super::measured_trial::MeasuredTrial;
use super::ramp::rounded;
use super::signal_check::SignalCheck;
use super::{
    clipped, emg, held_samples, hold, hold_jump, lever, onset, ramp, repeated_record, resistance, spike,
    wrong_row, zero_torque,
};
use crate::dataset::{Session, Status, Trial};

/// What the signals of `session` say against its table, in the order in which it is best mended.
pub fn contradictions(session: &Session) -> Vec<Contradiction> {
    let usable: Vec<&Trial> = session.trials.iter().filter(|trial| trial.status == Status::Ok).collect();
    let found = of_trials(&usable, session.sample_rate_hz);
    let held = held_samples::check_held(&usable, session.sample_rate_hz);
    let lever = session.lever.as_ref().and_then(lever::check_lever);
    let spikes = spike::check_spikes(&usable, session.sample_rate_hz);
    let clipped = clipped::check_clipped(&usable, &session.channel_ranges, session.sample_rate_hz);
    found
        .into_iter()
        .chain(held)
        .chain(spikes)
        .chain(hold_jump::check_jumps(&usable, session.sample_rate_hz))
        .chain(clipped)
        .chain(lever)
        .chain(emg::check_emg(&usable, session.sample_rate_hz))
        .chain(repeated_record::check_repeated(&usable, session.sample_rate_hz))
        .collect()
}

/// Checks `session`, whose contradictions of the kinds `accepted` are known and meant.
///
/// # Errors
/// The contradictions that are not accepted.
pub fn check(session: &Session, accepted: &[SignalCheck]) -> Result<Vec<Contradiction>, Contradictions> {
    let (known, refused): (Vec<_>, Vec<_>) =
        contradictions(session).into_iter().partition(|one| accepted.contains(&one.check));
    if refused.is_empty() { Ok(known) } else { Err(Contradictions(refused)) }
}

/// What speeds and torques say against the table of `session` once angle and torque are divided by the gains that a calibration found:
/// units or loads that were wrong when the rig was measured make a sound session contradict its table.
///
/// # Errors
/// The contradictions that are not among `accepted`.
pub fn check_with_gains(
    session: &Session,
    [angle_gain, torque_gain]: [f64; 2],
    accepted: &[SignalCheck],
) -> Result<(), Contradictions> {
    let corrected = |trial: &Trial| {
        let mut trial = trial.clone();
        trial.record.theta_m_rad.iter_mut().for_each(|value| *value /= angle_gain);
        trial.record.torque_l_nm.iter_mut().for_each(|value| *value /= torque_gain);
        MeasuredTrial::new(&trial, session.sample_rate_hz)
    };
    let usable = session.trials.iter().filter(|trial| trial.status == Status::Ok);
    let measured: Vec<MeasuredTrial> = usable.filter_map(corrected).collect();
    if measured.is_empty() {
        return Ok(());
    }
    let found = ramp::check_ramps(&measured).into_iter().chain(hold::check_torque(&measured));
    let refused: Vec<Contradiction> = found
        .filter(|one| !accepted.contains(&one.check))
        .map(|one| Contradiction {
            measured: format!("corrected by the calibration of the rig, {}", one.measured),
            likely_mistake: Some(format!(
                "By the calibration the angle is recorded {} and the torque {} times as large as it is, and without it they are as \
                 stated. Were the rig trials in other units, or the masses, arms and inertias of their loads not as stated?",
                rounded(angle_gain),
                rounded(torque_gain)
            )),
            remedy: "Correct rig-trials.csv and give ramphold calibrate again, or analyse the session with --calibration none.".into(),
            ..one
        })
        .collect();
    if refused.is_empty() { Ok(()) } else { Err(Contradictions(refused)) }
}

/// What the motion and the torque of `trials` say.
fn of_trials(trials: &[&Trial], sample_rate_hz: f64) -> Vec<Contradiction> {
    let measured = |trial: &&Trial| Some((MeasuredTrial::new(trial, sample_rate_hz)?, trial.onset_s));
    let (trials_measured, onsets): (Vec<MeasuredTrial>, Vec<Option<f64>>) =
        trials.iter().filter_map(measured).unzip();
    let is_still = |trial: &&&Trial| trials_measured.iter().all(|other| other.number != trial.number);
    let still: Vec<u32> = trials.iter().filter(is_still).map(|trial| trial.number).collect();
    let mut found = Vec::new();
    if 2 * still.len() > trials.len() {
        found.push(ramp::no_ramps(still));
    }
    if !trials_measured.is_empty() {
        found.extend(ramp::check_ramps(&trials_measured));
        found.extend(hold::check_torque(&trials_measured));
        found.extend(zero_torque::check_zero(&trials_measured));
    }
    if found.iter().any(|one| one.check == SignalCheck::RampSpeed) && are_swapped(trials, sample_rate_hz) {
        for one in &mut found {
            one.likely_mistake = Some("Are the columns theta_m_rad and torque_l_nm swapped?".into());
        }
        return found;
    }
    if trials_measured.is_empty() {
        return found;
    }
    if found.is_empty() {
        found.extend(wrong_row::check_rows(&trials_measured));
    }
    found.extend(onset::check_onsets(&trials_measured, &onsets, sample_rate_hz));
    found.extend(resistance::check_resistance(&trials_measured));
    found.extend(hold::check_angle(&trials_measured));
    found
}

/// Whether speeds and torques are those of the table once angle and torque change places.
fn are_swapped(trials: &[&Trial], sample_rate_hz: f64) -> bool {
    let swapped = |trial: &&Trial| {
        let mut turned = (*trial).clone();
        std::mem::swap(&mut turned.record.theta_m_rad, &mut turned.record.torque_l_nm);
        MeasuredTrial::new(&turned, sample_rate_hz)
    };
    let measured: Vec<MeasuredTrial> = trials.iter().filter_map(swapped).collect();
    2 * measured.len() > trials.len()
        && ramp::check_ramps(&measured).is_empty()
        && hold::check_torque(&measured).is_none()
}
