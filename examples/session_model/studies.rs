//! How often the analysis of variance of a study finds an effect, with the values of either fit.

use std::path::Path;

use ramphold::fit::{QUANTITIES, TrialEstimate};
use ramphold::random::Stream;
use ramphold::rig::virtual_wrist::Person;
use ramphold::statistics::{MeanCovariance, anova};
use ramphold::study::{
    ConditionGrid, SessionStorage, Study, StudyFit, Unit, UnitSource, effect_name, fit_unit,
};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::Failed;

/// Numbers of subjects of the studies.
const SUBJECTS: [usize; 3] = [8, 12, 20];

/// Number of studies drawn from the pool.
const STUDIES: u32 = 500;

/// Significance level, of Greenhouse and Geisser's p.
const LEVEL: f64 = 0.05;

/// A subject of the pool: the cells of the six parameters, as either fit has them and as they are.
struct Subject {
    cells: [Vec<Option<Vec<f64>>>; 2],
    truth: Vec<Vec<f64>>,
}

/// Simulates and fits a pool of subjects once, and draws studies from it without replacement. Each effect is counted twice: as it is,
/// and with the population's mean effect removed from the values, which shows the false positives.
pub fn count(file: &Path, subjects: u32, seed: u64) -> Result<Value, Failed> {
    let study = Study::open(file, seed)?.resized(subjects, 1);
    let protocol = study.protocol().ok_or("the subjects are virtual")?;
    let pairs =
        protocol.velocities_rad_s.iter().flat_map(|v| protocol.torques_nm.iter().map(move |t| (*v, *t)));
    let grid = ConditionGrid::of(pairs);
    let pool: Vec<Option<Subject>> = (0..study.units())
        .into_par_iter()
        .map(|index| subject(&study, index, &grid))
        .collect::<Result<_, _>>()?;
    let without_model = pool.iter().filter(|own| own.is_none()).count();
    let pool: Vec<Subject> = pool.into_iter().flatten().collect();
    let mut rows = Vec::new();
    for (place, fit) in [StudyFit::Independent, StudyFit::Session].into_iter().enumerate() {
        for (parameter, name) in QUANTITIES.iter().enumerate().take(6).skip(1) {
            let own: Vec<(&Vec<f64>, &Vec<f64>)> = pool
                .iter()
                .filter_map(|own| Some((own.cells[place][parameter].as_ref()?, &own.truth[parameter])))
                .collect();
            let cells = grid.conditions.len();
            let mean = |cell: usize| own.iter().map(|(_, truth)| truth[cell]).sum::<f64>() / own.len() as f64;
            let means: Vec<f64> = (0..cells).map(mean).collect();
            for is_null in [true, false] {
                let values: Vec<Vec<f64>> = own
                    .iter()
                    .map(|(found, _)| {
                        (0..cells).map(|cell| found[cell] - if is_null { means[cell] } else { 0.0 }).collect()
                    })
                    .collect();
                for count in SUBJECTS.into_iter().filter(|count| *count <= values.len()) {
                    let mut stream = Stream::new(seed, &format!("studies/{parameter}/{count}"));
                    let mut found: Vec<(&str, u32)> = Vec::new();
                    for _ in 0..STUDIES {
                        let mut order: Vec<usize> = (0..values.len()).collect();
                        for drawn in 0..count {
                            let rest = order.len() - drawn;
                            order.swap(drawn, drawn + stream.below(rest as u64) as usize);
                        }
                        let drawn = order[..count].iter().map(|subject| values[*subject].as_slice());
                        let moments = MeanCovariance::of(cells, drawn);
                        for effect in anova(&moments, grid.factor_levels()).unwrap_or_default() {
                            let name = effect_name(&effect);
                            let is_found = u32::from(effect.p_gg < LEVEL);
                            match found.iter_mut().find(|(own, _)| *own == name) {
                                Some((_, sum)) => *sum += is_found,
                                None => found.push((name, is_found)),
                            }
                        }
                    }
                    rows.extend(found.into_iter().map(|(effect, found)| {
                        let part = f64::from(found) / f64::from(STUDIES);
                        json!({
                            "fit": fit.name(), "parameter": name, "effect": effect, "subjects": count,
                            "effect_removed": is_null, "found": part,
                        })
                    }));
                }
            }
        }
    }
    Ok(json!({ "pool": pool.len(), "without_model": without_model, "studies": STUDIES, "rows": rows }))
}

/// `None` where the session has no model of its own.
fn subject(study: &Study, index: u64, grid: &ConditionGrid) -> Result<Option<Subject>, Failed> {
    let unit: Unit = study.unit(index);
    let UnitSource::Virtual { person, .. } = &unit.source else {
        return Err("the subjects are virtual".into());
    };
    let cells = |fit: StudyFit| -> Result<Option<Vec<Option<Vec<f64>>>>, Failed> {
        let mut study = study.clone();
        study.fit = fit;
        let found = fit_unit(&study, &unit, SessionStorage::Memory)?;
        let of = |parameter| grid.conditions.iter().map(|own| mean(&found.trials, parameter, *own)).collect();
        Ok((found.fit == fit).then(|| (0..6).map(of).collect()))
    };
    let (Some(alone), Some(together)) = (cells(StudyFit::Independent)?, cells(StudyFit::Session)?) else {
        return Ok(None);
    };
    let truth =
        (0..6).map(|parameter| grid.conditions.iter().map(|own| truth(person, parameter, *own)).collect());
    Ok(Some(Subject { cells: [alone, together], truth: truth.collect() }))
}

fn mean(trials: &[TrialEstimate], parameter: usize, condition: (f64, f64)) -> Option<f64> {
    let own = trials.iter().filter(|own| own.converged && (own.velocity_rad_s, own.torque_nm) == condition);
    let values: Vec<f64> = own.map(|own| own.values[parameter]).collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn truth(person: &Person, parameter: usize, (velocity, torque): (f64, f64)) -> f64 {
    match parameter {
        0 => person.joint_inertia_kg_m2,
        1 => person.interface_damping_nm_s_per_rad,
        2 => person.interface_stiffness_nm_per_rad.at(velocity, torque),
        3 => person.short_range_stiffness_nm_per_rad.at(velocity, torque),
        4 => person.stiffness_decrement_nm_per_rad.at(velocity, torque),
        _ => person.elastic_limit_rad.at(velocity, torque),
    }
}
