//! Records that are copies of one another: they count as repetitions that agree perfectly. A copy that was cut elsewhere, or got another
//! offset, is one all the same.

use std::collections::{HashMap, HashSet};
use std::hash::{DefaultHasher, Hash, Hasher};

use super::contradiction::Contradiction;
use super::signal_check::SignalCheck;
use crate::dataset::{Record, Trial};

/// Half of the time about the middle of the ramp in which records are compared, s.
const ABOUT_RAMP_S: f64 = 0.05;

/// To this, N m and rad, differences of torque and angle are rounded: far below any noise, and above what an offset changes by rounding.
const ROUNDED_TO: f64 = 1e-9;

/// Different steps that a torque must make to be told from another one by them: in coarse steps, two torques may be alike by chance.
const LEAST_STEPS: usize = 10;

/// The trials whose angle and torque are those of an earlier trial, sample by sample, or are about the ramp, but for a
/// constant.
pub fn check_repeated(trials: &[&Trial], sample_rate_hz: f64) -> Option<Contradiction> {
    // A computed torque without noise may well come twice.
    let measured: Vec<&&Trial> = trials.iter().filter(|trial| has_noise(&trial.record.torque_l_nm)).collect();
    let records: Vec<[&[f64]; 2]> = measured
        .iter()
        .map(|trial| [trial.record.theta_m_rad.as_slice(), trial.record.torque_l_nm.as_slice()])
        .collect();
    let steps: Vec<Vec<f64>> =
        measured.iter().map(|trial| steps_about_ramp(&trial.record, sample_rate_hz)).collect();
    let about_ramp: Vec<[&[f64]; 1]> = steps.iter().map(|own| [own.as_slice()]).collect();
    let (whole, about_ramp) = (repeated(&records), repeated(&about_ramp));
    let (found, equal) = if whole.is_empty() {
        (
            about_ramp,
            format!(
                "their angles and torques differ by constants within {ABOUT_RAMP_S} s of the middle of the ramp"
            ),
        )
    } else {
        (whole, "their angle and torque are equal in every sample".to_owned())
    };
    let (first, _) = *found.first()?;
    let copies: Vec<u32> =
        found.iter().filter(|pair| pair.0 == first).map(|pair| measured[pair.1].number).collect();
    let numbers = std::iter::once(measured[first].number).chain(copies).collect();
    Some(Contradiction {
        check: SignalCheck::RepeatedRecord,
        place: "columns theta_m_rad and torque_l_nm of the records".into(),
        trials: numbers,
        measured: equal,
        stated: "a record of its own for each trial: noise never comes twice".into(),
        likely_mistake: Some("Was a file copied, exported twice, or cut in two ways?".into()),
        remedy: "Put each trial's own record there, or set all but one of these trials to rejected with ramphold trials --reject."
            .into(),
    })
}

/// The first pair of records, by their places, whose signals are equal in every sample.
pub(crate) fn first_repeated(records: &[[&[f64]; 2]]) -> Option<(usize, usize)> {
    repeated(records).first().copied()
}

/// Steps of torque and angle from sample to sample about the middle of the ramp, in units of [`ROUNDED_TO`]; empty without a whole ramp, or
/// if those of the torque are too few to tell one from another.
fn steps_about_ramp(record: &Record, sample_rate_hz: f64) -> Vec<f64> {
    let angle = &record.theta_m_rad;
    let (low, high) =
        angle.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), own| (a.min(*own), b.max(*own)));
    let first = angle.first().copied().unwrap_or(0.0);
    let half = 0.5 * (high - low);
    let middle = angle.iter().position(|own| (own - first).abs() > half).unwrap_or(0);
    let reach = (ABOUT_RAMP_S * sample_rate_hz) as usize;
    let steps = |signal: &[f64]| -> Vec<f64> {
        let about = middle.checked_sub(reach).and_then(|from| signal.get(from..middle + reach));
        let steps = about.unwrap_or_default().windows(2).map(|pair| (pair[1] - pair[0]) / ROUNDED_TO);
        steps.map(libm::round).collect()
    };
    let torque = steps(&record.torque_l_nm);
    let different: HashSet<u64> = torque.iter().filter(|own| **own != 0.0).map(|own| own.to_bits()).collect();
    if different.len() < LEAST_STEPS { Vec::new() } else { [torque, steps(angle)].concat() }
}

/// For each record that is equal to an earlier one, the place of the first such and its own.
fn repeated<const SIGNALS: usize>(records: &[[&[f64]; SIGNALS]]) -> Vec<(usize, usize)> {
    let mut seen: HashMap<u64, Vec<usize>> = HashMap::new();
    let mut repeated = Vec::new();
    for (place, record) in records.iter().enumerate().filter(|(_, record)| !record[0].is_empty()) {
        let alike = seen.entry(sum(record)).or_default();
        match alike.iter().find(|earlier| records[**earlier] == *record) {
            Some(earlier) => repeated.push((*earlier, place)),
            None => alike.push(place),
        }
    }
    repeated
}

fn sum(record: &[&[f64]]) -> u64 {
    let mut sum = DefaultHasher::new();
    record.iter().flat_map(|signal| *signal).for_each(|value| value.to_bits().hash(&mut sum));
    sum.finish()
}

/// Whether a torque at rest changes at all: that of the first twentieth of a record, in which no ramp is.
pub(super) fn has_noise(torque_nm: &[f64]) -> bool {
    torque_nm[..torque_nm.len() / 20].windows(2).any(|pair| pair[0] != pair[1])
}
