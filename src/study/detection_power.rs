//! How many persons and repetitions it takes until a mechanism of a given size is found.
//!
//! A session names a mechanism, or it does not. A study has found it if more of its sessions name it than false alarms would:
//! the binomial tail of that many, at the rate that a diagnosis promises to keep, is below the level.

use rayon::prelude::*;

use super::error::UnitError;
use super::plan::{Study, What};
use super::power::{Drawing, Found};
use super::unit_session::{Kept, simulate, view};
use crate::diagnose::{Look, diagnose};
use crate::fit::Model;
use crate::random::Stream;
use crate::rig::virtual_wrist::MechanismList;

/// Share of sessions without any mechanism in which a diagnosis may name one.
pub const FALSE_ALARMS: f64 = 0.05;

/// Whether each person's session named the mechanism, with so many repetitions.
#[derive(Debug, Clone, PartialEq)]
pub struct Named {
    /// Repetitions of each condition.
    pub repetitions: u32,
    /// By person.
    pub named: Vec<bool>,
}

/// Runs each person of a pool with `mechanisms` at work in the rig, and diagnoses the session with each number of repetitions.
pub fn detections(
    study: &Study,
    mechanisms: &MechanismList,
    drawing: &Drawing,
    done: impl Fn() + Sync,
) -> Result<Vec<Named>, UnitError> {
    let study = study.clone().resized(drawing.pool, 1);
    let sessions: Vec<Result<Vec<bool>, UnitError>> = (0..study.units())
        .into_par_iter()
        .map(|index| {
            let named = of_unit(&study, index, mechanisms, &drawing.repetitions);
            done();
            named
        })
        .collect();
    let sessions = sessions.into_iter().collect::<Result<Vec<_>, _>>()?;
    let of_repetitions = |(place, repetitions): (usize, &u32)| Named {
        repetitions: *repetitions,
        named: sessions.iter().map(|session| session[place]).collect(),
    };
    Ok(drawing.repetitions.iter().enumerate().map(of_repetitions).collect())
}

fn of_unit(
    study: &Study,
    index: u64,
    mechanisms: &MechanismList,
    repetitions: &[u32],
) -> Result<Vec<bool>, UnitError> {
    let mut unit = study.unit(index);
    let (What::Virtual { setup, protocol, .. }, seed) = (&unit.what, index) else { return Ok(Vec::new()) };
    let (mut with, protocol) = ((*setup).clone(), *protocol);
    with.mechanisms = with.mechanisms.and(mechanisms);
    if let What::Virtual { setup, .. } = &mut unit.what {
        *setup = &with;
    }
    let Some(session) = simulate(&unit, Kept::No)? else { return Ok(Vec::new()) };
    let named = |most: &u32| {
        let mut part = session.clone();
        part.trials.retain(|trial| trial.repetition <= *most);
        let model = Model::paper();
        let diagnosis = diagnose(&Look::new(&part, view(protocol), &model)?, &model, seed, &|_| ());
        let kinds = diagnosis.causes.iter().map(|cause| cause.kind.id());
        Ok(kinds.into_iter().any(|id| mechanisms.kinds.iter().any(|kind| kind.id() == id)))
    };
    repetitions.iter().map(named).collect()
}

/// How often studies drawn from the pool find the mechanism.
pub fn found(study: &Study, named: &[Named], drawing: &Drawing) -> Vec<Found> {
    let mut all = Vec::new();
    for own in named {
        let share = own.named.iter().filter(|named| **named).count() as f64 / own.named.len().max(1) as f64;
        for persons in &drawing.persons {
            let needed = needed(*persons, drawing.alpha);
            let mut stream = Stream::new(study.seed, &format!("detection/{persons}/{}", own.repetitions));
            let mut draw = || own.named[stream.below(own.named.len() as u64) as usize];
            let studies = (0..drawing.studies)
                .filter(|_| (0..*persons).filter(|_| draw()).count() as u32 >= needed)
                .count() as u32;
            let (persons, repetitions, of) = (*persons, own.repetitions, drawing.studies);
            all.push(Found { persons, repetitions, found: studies, of, effect: share });
        }
    }
    all
}

/// So many of the sessions must name it that chance would not.
fn needed(persons: u32, alpha: f64) -> u32 {
    let n = f64::from(persons);
    let mut tail = 1.0;
    // P(at least k) = P(at least k - 1) - P(k - 1).
    let mut exactly = libm::pow(1.0 - FALSE_ALARMS, n);
    for k in 0..=persons {
        if tail < alpha {
            return k;
        }
        tail -= exactly;
        exactly *= (n - f64::from(k)) / f64::from(k + 1) * FALSE_ALARMS / (1.0 - FALSE_ALARMS);
    }
    persons + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn more_sessions_must_name_it_than_false_alarms_would() {
        // Binomial tails at 0.05: 2 of 3 have 0.00725; 2 of 8 have 0.0572, 3 of 8 have 0.0058; 5 of 40 have 0.0480.
        assert_eq!([3, 8, 40].map(|persons| needed(persons, 0.05)), [2, 3, 5]);
    }
}
