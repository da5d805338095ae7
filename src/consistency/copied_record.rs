//! Records that are copies of each other.

use super::contradiction::Contradiction;
use super::signal_check::SignalCheck;
use crate::dataset::Trial;

/// Samples in which noise shows itself, long before the ramp.
const BEGIN: usize = 50;

/// Trials whose torque is that of an earlier trial to the last bit: a gauge's noise never repeats. A simulation without noise does.
pub fn check_copies(trials: &[&Trial]) -> Option<Contradiction> {
    let torque = |trial: &Trial| -> Vec<u64> {
        trial.record.torque_l_nm.iter().map(|value| value.to_bits()).collect()
    };
    let mut first_with = std::collections::HashMap::new();
    let mut copies = Vec::new();
    for trial in trials.iter().filter(|trial| is_noisy(&trial.record.torque_l_nm)) {
        let first = *first_with.entry(torque(trial)).or_insert(trial.number);
        if first != trial.number {
            copies.push((first, trial.number));
        }
    }
    let (first, copy) = *copies.first()?;
    Some(Contradiction {
        check: SignalCheck::CopiedRecord,
        place: "trials.csv, column file".into(),
        trials: copies.iter().map(|(_, copy)| *copy).collect(),
        measured: format!("trial {copy} has the torque of trial {first} to the last digit"),
        stated: "a record of its own".into(),
        likely_mistake: Some("Was a file copied, or exported twice?".into()),
        remedy: "Give each trial its own record, or set the status of the copies to rejected: they would count as repetitions.".into(),
    })
}

/// Whether most of the values differ from the one before, from the begin of the record on.
fn is_noisy(torque_nm: &[f64]) -> bool {
    let begin = &torque_nm[..torque_nm.len().min(BEGIN)];
    let changes = begin.windows(2).filter(|pair| pair[0] != pair[1]).count();
    2 * changes > begin.len()
}
