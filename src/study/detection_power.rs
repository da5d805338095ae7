//! Power of a study to detect a mechanism: how many subjects and repetitions are needed.
//!
//! The diagnosis of a session names the mechanism or not. A study detects the mechanism if more of its sessions name it than false
//! alarms explain: the binomial probability of as many false alarms is below the significance level.

use rayon::prelude::*;

use super::error::UnitError;
use super::plan::{Study, UnitSource};
use super::power::{PowerEstimate, ResamplingPlan};
use super::unit_session::{SessionStorage, simulate_unit};
use crate::diagnose::{DiagnosisInput, diagnose};
use crate::fit::{Model, PreprocessingSettings};
use crate::random::Stream;
use crate::rig::virtual_wrist::MechanismList;

/// Probability that the diagnosis of a session without any mechanism names one, by design of its tests.
pub const FALSE_ALARM_RATE: f64 = 0.05;

/// Whether the diagnosis of each subject's session named the mechanism.
#[derive(Debug, Clone, PartialEq)]
pub struct Detections {
    /// Number of repetitions of each condition in the diagnosed session.
    pub repetitions: u32,
    /// One element per subject of the pool.
    pub named: Vec<bool>,
}

/// Simulates a session of each subject of a pool with `mechanisms` active, and diagnoses it with each number of repetitions. `done` is
/// called after each session.
///
/// # Errors
/// If a session cannot be simulated or preprocessed.
pub fn detections(
    study: &Study,
    mechanisms: &MechanismList,
    resampling: &ResamplingPlan,
    done: impl Fn() + Sync,
) -> Result<Vec<Detections>, UnitError> {
    let study = study.clone().resized(resampling.pool, 1);
    let sessions: Vec<Result<Vec<bool>, UnitError>> = (0..study.units())
        .into_par_iter()
        .map(|index| {
            let named = detections_in_unit(&study, index, mechanisms, &resampling.repetitions);
            done();
            named
        })
        .collect();
    let sessions = sessions.into_iter().collect::<Result<Vec<_>, _>>()?;
    let of_repetitions = |(place, repetitions): (usize, &u32)| Detections {
        repetitions: *repetitions,
        named: sessions.iter().map(|session| session[place]).collect(),
    };
    Ok(resampling.repetitions.iter().enumerate().map(of_repetitions).collect())
}

fn detections_in_unit(
    study: &Study,
    index: u64,
    mechanisms: &MechanismList,
    repetitions: &[u32],
) -> Result<Vec<bool>, UnitError> {
    let mut unit = study.unit(index);
    let (UnitSource::Virtual { setup, protocol, .. }, seed) = (&unit.source, index) else {
        return Ok(Vec::new());
    };
    let (mut with, protocol) = ((*setup).clone(), *protocol);
    with.mechanisms = with.mechanisms.and(mechanisms);
    if let UnitSource::Virtual { setup, .. } = &mut unit.source {
        *setup = &with;
    }
    let Some(session) = simulate_unit(&unit, SessionStorage::Memory)? else { return Ok(Vec::new()) };
    let named = |most: &u32| {
        let mut part = session.clone();
        part.trials.retain(|trial| trial.repetition <= *most);
        let model = Model::paper();
        let input = DiagnosisInput::new(&part, PreprocessingSettings::of(protocol), &model)?;
        let diagnosis = diagnose(&input, &model, seed, &|_| ());
        let kinds = diagnosis.causes.iter().map(|cause| cause.kind.id());
        Ok(kinds.into_iter().any(|id| mechanisms.kinds.iter().any(|kind| kind.id() == id)))
    };
    repetitions.iter().map(named).collect()
}

/// Power of studies drawn from the pool to detect the mechanism.
pub fn detection_power(
    study: &Study,
    detections: &[Detections],
    resampling: &ResamplingPlan,
) -> Vec<PowerEstimate> {
    let mut all = Vec::new();
    for own in detections {
        let share = own.named.iter().filter(|named| **named).count() as f64 / own.named.len().max(1) as f64;
        for subjects in &resampling.subjects {
            let needed = needed_detections(*subjects, resampling.alpha);
            let mut stream = Stream::new(study.seed, &format!("detection/{subjects}/{}", own.repetitions));
            let mut draw = || own.named[stream.below(own.named.len() as u64) as usize];
            let found = (0..resampling.studies)
                .filter(|_| (0..*subjects).filter(|_| draw()).count() as u32 >= needed)
                .count() as u32;
            let (subjects, repetitions, studies) = (*subjects, own.repetitions, resampling.studies);
            all.push(PowerEstimate { subjects, repetitions, found, studies, untested: 0, effect: share });
        }
    }
    all
}

/// Smallest number of sessions naming the mechanism that has a probability below `alpha` by false alarms alone.
fn needed_detections(subjects: u32, alpha: f64) -> u32 {
    let n = f64::from(subjects);
    let mut tail = 1.0;
    // P(at least k) = P(at least k - 1) - P(k - 1).
    let mut exactly = libm::pow(1.0 - FALSE_ALARM_RATE, n);
    for k in 0..=subjects {
        if tail < alpha {
            return k;
        }
        tail -= exactly;
        exactly *= (n - f64::from(k)) / f64::from(k + 1) * FALSE_ALARM_RATE / (1.0 - FALSE_ALARM_RATE);
    }
    subjects + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn needed_detections_exceed_the_binomial_quantile_of_false_alarms() {
        // Binomial tails at 0.05: 2 of 3 have 0.00725; 2 of 8 have 0.0572, 3 of 8 have 0.0058; 5 of 40 have 0.0480.
        assert_eq!([3, 8, 40].map(|subjects| needed_detections(subjects, 0.05)), [2, 3, 5]);
    }
}
