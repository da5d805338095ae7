//! How often sessions go wrong, and whether their tables say so.

use ramphold::fit::{K_SRS, SessionFit, TrialEstimate, X_E, estimates_without_profiles, session_estimates};
use ramphold::protocol::ValidProtocol;
use ramphold::rig::TrialKey;
use ramphold::rig::virtual_wrist::{Person, Setup, VirtualWrist};
use rayon::prelude::*;
use serde_json::{Value, json};

use super::{Failed, fit_independently, simulate};

/// Half the width of a 95 % interval, in standard errors.
const WIDTH: f64 = 1.959_963_984_540_054;

/// A gross error: off by more than this part, and by more than the stated error allows.
const GROSS: [(usize, f64); 2] = [(K_SRS, 0.2), (X_E, 0.4)];

/// Trials, grossly wrong trials and marked trials.
pub fn count(protocol: &ValidProtocol, sessions: u64, seed: u64) -> Result<Value, Failed> {
    let counts: Vec<[usize; 6]> = (seed..seed + sessions)
        .into_par_iter()
        .map(|seed| of_session(protocol, seed))
        .collect::<Result<_, Failed>>()?;
    let sum = |place: usize| counts.iter().map(|own| own[place]).sum::<usize>();
    Ok(json!({
        "trials": sum(0), "gross_independent": sum(1), "gross": sum(2), "gross_unmarked": sum(3), "marked": sum(4), "without_model": sum(5),
    }))
}

fn of_session(protocol: &ValidProtocol, seed: u64) -> Result<[usize; 6], Failed> {
    let person = Person::drawn(&format!("session model {seed}"));
    let session = simulate(protocol, &person, seed)?;
    // Where no trial was rejected, a trial's number is its position. The few other sessions are passed over.
    if session.trials.len() != protocol.trial_count() {
        return Ok([0; 6]);
    }
    let wrist = VirtualWrist::new(person, Setup::default(), seed, protocol.signal.sample_rate_hz);
    let (observations, fit) = fit_independently(protocol, &session)?;
    let alone = estimates_without_profiles(&observations, &fit);
    let is_gross = |own: &&TrialEstimate| {
        let key = TrialKey { practice: false, position: own.trial, rejections: 0 };
        let truth = wrist.trial_parameters(key, own.velocity_rad_s, own.torque_nm);
        GROSS.iter().any(|(parameter, part)| {
            let error = (own.values[*parameter] / truth[*parameter]).ln().abs();
            error > part.ln_1p() && own.se[*parameter].is_some_and(|se| WIDTH * se < error)
        })
    };
    let gross_alone = alone.iter().filter(is_gross).count();
    let Ok(of_session) = SessionFit::new(&observations, &fit) else {
        return Ok([alone.len(), gross_alone, 0, 0, 0, 1]);
    };
    let (together, _) = session_estimates(&observations, &of_session);
    let is_marked = |own: &&TrialEstimate| !own.other_optima.is_empty();
    Ok([
        alone.len(),
        gross_alone,
        together.iter().filter(is_gross).count(),
        together.iter().filter(is_gross).filter(|own| !is_marked(own)).count(),
        together.iter().filter(is_marked).count(),
        0,
    ])
}
