//! Records that are copies of one another: they count as repetitions that agree perfectly.

use std::collections::HashMap;
use std::hash::{DefaultHasher, Hash, Hasher};

use super::contradiction::Contradiction;
use super::signal_check::SignalCheck;
use crate::dataset::Trial;

/// The trials whose angle and torque are those of an earlier trial, sample by sample.
pub fn check_repeated(trials: &[&Trial]) -> Option<Contradiction> {
    // A computed torque without noise may well come twice.
    let measured: Vec<&&Trial> = trials.iter().filter(|trial| has_noise(&trial.record.torque_l_nm)).collect();
    let records: Vec<[&[f64]; 2]> = measured
        .iter()
        .map(|trial| [trial.record.theta_m_rad.as_slice(), trial.record.torque_l_nm.as_slice()])
        .collect();
    let repeated = repeated(&records);
    let (first, _) = *repeated.first()?;
    let copies: Vec<u32> =
        repeated.iter().filter(|pair| pair.0 == first).map(|pair| measured[pair.1].number).collect();
    let numbers = std::iter::once(measured[first].number).chain(copies).collect();
    Some(Contradiction {
        check: SignalCheck::RepeatedRecord,
        place: "columns theta_m_rad and torque_l_nm of the records".into(),
        trials: numbers,
        measured: "their angle and torque are equal in every sample".into(),
        stated: "a record of its own for each trial: noise never comes twice".into(),
        likely_mistake: Some("Was a file copied, or exported twice?".into()),
        remedy: "Put each trial's own record there, or set all but one of these trials to rejected with ramphold trials --reject."
            .into(),
    })
}

/// The first pair of records, by their places, whose signals are equal in every sample.
pub(crate) fn first_repeated(records: &[[&[f64]; 2]]) -> Option<(usize, usize)> {
    repeated(records).first().copied()
}

/// For each record that is equal to an earlier one, the place of the first such and its own.
fn repeated(records: &[[&[f64]; 2]]) -> Vec<(usize, usize)> {
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

fn sum(record: &[&[f64]; 2]) -> u64 {
    let mut sum = DefaultHasher::new();
    record.iter().flat_map(|signal| *signal).for_each(|value| value.to_bits().hash(&mut sum));
    sum.finish()
}

/// Whether a torque at rest changes at all: that of the first twentieth of a record, in which no ramp is.
pub(super) fn has_noise(torque_nm: &[f64]) -> bool {
    torque_nm[..torque_nm.len() / 20].windows(2).any(|pair| pair[0] != pair[1])
}
