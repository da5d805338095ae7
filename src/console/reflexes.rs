//! EMG of the trials so far: the onset of the response of the stretched muscle, found as in the report.

use std::collections::BTreeMap;

use crate::dataset::Trial;
use crate::report::{TrialEmg, find_onsets, trial_emg};

/// The EMG of the trials that count.
#[derive(Debug, Default)]
pub struct Reflexes {
    trials: BTreeMap<u32, TrialEmg>,
}

impl Reflexes {
    /// Adds a trial, if it has EMG and an onset. All onsets are found anew, for the holds of all trials make the level that a response exceeds.
    pub fn add(&mut self, trial: &Trial, sample_rate_hz: f64) {
        let record = &trial.record;
        let Some(onset_s) = trial.onset_s else { return };
        let onset = libm::round((onset_s - record.start_s) * sample_rate_hz).max(0.0) as usize;
        let Some(emg) = trial_emg(record, onset, trial.velocity_rad_s, 1.0 / sample_rate_hz) else { return };
        self.trials.insert(trial.number, emg);
        self.find();
    }

    /// Removes a trial that does not count any more.
    pub fn remove(&mut self, number: u32) {
        if self.trials.remove(&number).is_some() {
            self.find();
        }
    }

    /// Whether a trial has EMG.
    pub fn has(&self, number: u32) -> bool {
        self.trials.contains_key(&number)
    }

    /// Latency of the response of a trial, s; `None` if none stands out, or the trials are too few to tell.
    pub fn latency_s(&self, number: u32) -> Option<f64> {
        self.trials.get(&number)?.onset_s
    }

    fn find(&mut self) {
        self.trials.values_mut().for_each(|emg| emg.onset_s = None);
        find_onsets(&mut self.trials.values_mut().collect::<Vec<_>>());
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{Record, Status};
    use crate::random::Stream;

    /// Trials of 1.5 s at 1 kHz, whose ramp begins at 1 s and whose flexor responds 40 ms later.
    fn trials(count: u32) -> Vec<Trial> {
        let mut stream = Stream::new(1, "reflexes");
        let mut trial = |number| {
            let level = |sample: usize| if (1040..1070).contains(&sample) { 8.0 } else { 1.0 };
            let emg = (0..1500).map(|sample| 0.02 * level(sample) * stream.normal()).collect();
            Trial {
                number,
                file: String::new(),
                velocity_rad_s: 2.0,
                torque_nm: 1.0,
                repetition: number,
                condition: None,
                onset_s: Some(1.0),
                status: Status::Ok,
                extra: BTreeMap::new(),
                record: Record { emg_fcr_mvc: Some(emg), ..Record::default() },
            }
        };
        (1..=count).map(&mut trial).collect()
    }

    #[test]
    fn latencies_appear_once_there_are_holds_enough_and_earlier_trials_get_theirs_too() {
        let mut reflexes = Reflexes::default();
        let latencies = |own: &Reflexes| (1..=6).map(|number| own.latency_s(number)).collect::<Vec<_>>();
        for trial in trials(6) {
            reflexes.add(&trial, 1000.0);
            let is_told = latencies(&reflexes).iter().any(Option::is_some);
            assert_eq!(is_told, trial.number > 4, "after trial {}: {:?}", trial.number, latencies(&reflexes));
        }
        let near = |own: &Option<f64>| own.is_some_and(|latency_s| (0.034..0.046).contains(&latency_s));
        assert!(
            latencies(&reflexes).iter().filter(|own| near(own)).count() >= 5,
            "{:?}",
            latencies(&reflexes)
        );
    }

    #[test]
    fn a_trial_that_does_not_count_any_more_has_no_latency_and_one_without_emg_none_either() {
        let mut reflexes = Reflexes::default();
        trials(6).iter().for_each(|trial| reflexes.add(trial, 1000.0));
        reflexes.remove(6);
        assert!(!reflexes.has(6) && reflexes.latency_s(6).is_none());
        let bare = Trial { number: 7, record: Record::default(), ..trials(1).remove(0) };
        reflexes.add(&bare, 1000.0);
        assert!(!reflexes.has(7) && reflexes.has(5));
    }
}
