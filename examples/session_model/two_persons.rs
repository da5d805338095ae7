//! How often the trials of two persons in one folder are noticed.

use ramphold::fit::{NoSessionModel, SessionFit};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::virtual_wrist::Person;
use rayon::prelude::*;
use serde_json::{Value, json};

use super::{Failed, fit_independently, simulate};

/// The last `later_part` of the trials are those of a person with `stiffness_ratio` times the short-range stiffness and decrement.
pub fn count(
    protocol: &ValidProtocol,
    sessions: u64,
    seed: u64,
    stiffness_ratio: f64,
    later_part: f64,
) -> Result<Value, Failed> {
    let found: Vec<(bool, Option<f64>)> = (seed..seed + sessions)
        .into_par_iter()
        .map(|seed| {
            let person = Person::drawn(&format!("session model {seed}"));
            let mut other = person.clone();
            for surface in
                [&mut other.short_range_stiffness_nm_per_rad, &mut other.stiffness_decrement_nm_per_rad]
            {
                for value in [&mut surface.at_lowest, &mut surface.per_rad_s, &mut surface.per_nm] {
                    *value *= stiffness_ratio;
                }
            }
            let mut session = simulate(protocol, &person, seed)?;
            let first = session.trials.len() - (later_part * session.trials.len() as f64).round() as usize;
            let others = simulate(protocol, &other, seed)?.trials;
            for (trial, other) in session.trials.iter_mut().zip(others).skip(first) {
                trial.record = other.record;
            }
            let (observations, fit) = fit_independently(protocol, &session)?;
            let of_session = SessionFit::new(&observations, &fit);
            let statistic =
                of_session.as_ref().ok().and_then(|own| own.groups.as_ref()).map(|own| own.statistic);
            let is_noticed = matches!(
                of_session,
                Err(NoSessionModel::TwoGroups { .. } | NoSessionModel::SpreadBeyondPerson { .. })
            );
            Ok((is_noticed, statistic))
        })
        .collect::<Result<_, Failed>>()?;
    let noticed = found.iter().filter(|(noticed, _)| *noticed).count();
    let largest = found.iter().filter_map(|(_, statistic)| *statistic).fold(0.0, f64::max);
    Ok(json!({ "sessions": found.len(), "noticed": noticed, "largest_statistic": largest }))
}
