//! The last ramps of each condition, to be drawn over each other.

use std::collections::VecDeque;

use serde_json::{Value, json};

use crate::dataset::Trial;

/// Number of ramps that are kept of each condition.
const RAMPS_KEPT: usize = 6;
/// Part of a trial that is kept: before and after the onset of the ramp, s.
const KEPT_S: [f64; 2] = [0.02, 0.12];
/// Highest sample rate of what is kept, Hz.
const KEPT_RATE_HZ: f64 = 1250.0;

/// The last ramps of each condition.
#[derive(Debug, Default)]
pub struct Ramps {
    /// Of each condition, ordered by torque and velocity; the latest ramp is the last.
    conditions: Vec<VecDeque<RampTrace>>,
}

/// The torque about the onset of a ramp.
#[derive(Debug, Clone, PartialEq)]
struct RampTrace {
    trial: u32,
    torque_nm: f64,
    velocity_rad_s: f64,
    repetition: u32,
    period_s: f64,
    /// Change of torque from its mean before the onset, N m; the first value is of [`KEPT_S`] before the onset.
    change_nm: Vec<f64>,
}

impl RampTrace {
    fn of(trial: &Trial, sample_rate_hz: f64) -> Option<Self> {
        let record = &trial.record;
        let onset = ((trial.onset_s? - record.start_s) * sample_rate_hz).round();
        let [before, after] = KEPT_S.map(|time_s| (time_s * sample_rate_hz).round());
        if onset < before {
            return None;
        }
        let every = (sample_rate_hz / KEPT_RATE_HZ).ceil().max(1.0) as usize;
        let (first, onset) = ((onset - before) as usize, onset as usize);
        let kept = record.torque_l_nm.get(first..)?;
        let level_nm = kept.get(..onset - first)?.iter().sum::<f64>() / before.max(1.0);
        let change =
            kept.iter().take((before + after) as usize).step_by(every).map(|torque| torque - level_nm);
        Some(Self {
            trial: trial.number,
            torque_nm: trial.torque_nm,
            velocity_rad_s: trial.velocity_rad_s,
            repetition: trial.repetition,
            period_s: every as f64 / sample_rate_hz,
            change_nm: change.map(|change| (change * 1e4).round() / 1e4).collect(),
        })
    }
}

impl Ramps {
    /// Adds the ramp of a trial, if it has one.
    pub fn add(&mut self, trial: &Trial, sample_rate_hz: f64) {
        let Some(trace) = RampTrace::of(trial, sample_rate_hz) else { return };
        self.remove(trace.trial);
        let order = |traces: &VecDeque<RampTrace>| {
            let torque = traces[0].torque_nm.total_cmp(&trace.torque_nm);
            torque.then(traces[0].velocity_rad_s.total_cmp(&trace.velocity_rad_s))
        };
        match self.conditions.binary_search_by(order) {
            Ok(place) => {
                let traces = &mut self.conditions[place];
                traces.push_back(trace);
                if traces.len() > RAMPS_KEPT {
                    traces.pop_front();
                }
            }
            Err(place) => self.conditions.insert(place, VecDeque::from([trace])),
        }
    }

    /// Removes the ramp of a trial that does not count any more.
    pub fn remove(&mut self, trial: u32) {
        self.conditions.iter_mut().for_each(|traces| traces.retain(|trace| trace.trial != trial));
        self.conditions.retain(|traces| !traces.is_empty());
    }

    /// The ramps as JSON; `window_s` is the analysed window after the onset.
    pub fn json(&self, window_s: f64) -> String {
        let trace = |trace: &RampTrace| json!({ "trial": trace.trial, "repetition": trace.repetition, "change_nm": trace.change_nm });
        let condition = |traces: &VecDeque<RampTrace>| -> Option<Value> {
            let latest = traces.back()?;
            Some(json!({
                "torque_nm": latest.torque_nm,
                "velocity_rad_s": latest.velocity_rad_s,
                "latest": latest.trial,
                "period_s": latest.period_s,
                "ramps": traces.iter().map(trace).collect::<Vec<_>>(),
            }))
        };
        let conditions: Vec<Value> = self.conditions.iter().filter_map(condition).collect();
        json!({ "kind": "ramps", "before_s": KEPT_S[0], "window_s": window_s, "conditions": conditions })
            .to_string()
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::dataset::{Record, Status};

    fn trial(number: u32, torque_nm: f64) -> Trial {
        let torque_l_nm = (0..500).map(|sample| torque_nm + if sample < 100 { 0.0 } else { 1.0 }).collect();
        Trial {
            number,
            file: String::new(),
            velocity_rad_s: 1.3,
            torque_nm,
            repetition: number,
            condition: None,
            onset_s: Some(0.1),
            status: Status::Ok,
            extra: BTreeMap::new(),
            record: Record { torque_l_nm, ..Record::default() },
        }
    }

    #[test]
    fn the_latest_ramps_of_each_condition_begin_at_the_same_level() {
        let mut ramps = Ramps::default();
        (1..=8).for_each(|number| ramps.add(&trial(number, 0.9), 1000.0));
        ramps.add(&trial(9, 2.1), 1000.0);
        ramps.remove(8);
        let shown: Value = serde_json::from_str(&ramps.json(0.04)).unwrap();
        let numbers = |condition: usize| -> Vec<u64> {
            let ramps = shown["conditions"][condition]["ramps"].as_array().unwrap();
            ramps.iter().map(|ramp| ramp["trial"].as_u64().unwrap()).collect()
        };
        assert_eq!((numbers(0), numbers(1)), (vec![3, 4, 5, 6, 7], vec![9]));
        let change = &shown["conditions"][0]["ramps"][0]["change_nm"];
        assert_eq!(
            (change.as_array().unwrap().len(), &change[19], &change[20]),
            (140, &json!(0.0), &json!(1.0))
        );
    }
}
