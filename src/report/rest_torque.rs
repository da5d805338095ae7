//! The torque at rest before the hold of each trial: the offset of the sensor, trial by trial.
//!
//! The record of a trial begins when its target is shown. Nobody reacts to that within a tenth of a second, so what is recorded before is
//! the torque of a hand at rest.

use super::journal::SessionTimes;
use crate::dataset::Session;
use crate::statistics::upper_median;

/// Nobody reacts to a target that is shown within this time, s: a start within 0.1 s of the signal counts as false in athletics, and the
/// simple reaction to what is seen takes about 0.2 s.
pub const REACTION_S: f64 = 0.1;

/// Fewest trials of which a drift is told: three in each third.
const FEWEST_TRIALS: usize = 9;

/// Torque at rest before the hold of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RestTorque {
    /// Number of the trial.
    pub trial: u32,
    /// Mean, N m.
    pub mean_nm: f64,
    /// Standard deviation of the samples, N m.
    pub sd_nm: f64,
}

/// The torque at rest before each trial that the journal has; empty for a session without one, whose records may begin in the hold.
pub fn rest_torques(session: &Session, times: Option<&SessionTimes>) -> Vec<RestTorque> {
    let Some(times) = times else { return Vec::new() };
    let samples = (REACTION_S * session.sample_rate_hz) as usize;
    let of_trial = |trial: &crate::dataset::Trial| {
        times.gates.iter().find(|(number, _)| *number == trial.number)?;
        let own = trial.record.torque_l_nm.get(..samples).filter(|own| own.len() > 1)?;
        let mean_nm = own.iter().sum::<f64>() / own.len() as f64;
        let square: f64 = own.iter().map(|torque| (torque - mean_nm) * (torque - mean_nm)).sum();
        Some(RestTorque { trial: trial.number, mean_nm, sd_nm: (square / (own.len() - 1) as f64).sqrt() })
    };
    session.trials.iter().filter_map(of_trial).collect()
}

/// How far the torque at rest drifted over the session, N m: the median of the last third of the trials less that of the first. Single
/// trials in which the hand was not at rest count little. `None` for few trials.
pub fn drift_nm(rests: &[RestTorque]) -> Option<f64> {
    let third = rests.len() / 3;
    let median = |own: &[RestTorque]| upper_median(own.iter().map(|rest| rest.mean_nm)).unwrap_or(f64::NAN);
    (rests.len() >= FEWEST_TRIALS).then(|| median(&rests[rests.len() - third..]) - median(&rests[..third]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_drift_is_told_though_a_hand_was_not_at_rest_once() {
        let rests: Vec<RestTorque> = (0..30)
            .map(|at| RestTorque {
                trial: at + 1,
                mean_nm: 0.01 * f64::from(at) + if at == 28 { 2.0 } else { 0.0 },
                sd_nm: 0.01,
            })
            .collect();
        let drift = drift_nm(&rests).unwrap();
        assert!((drift - 0.2).abs() < 1e-9, "{drift}");
        assert_eq!(drift_nm(&rests[..8]), None);
    }
}
