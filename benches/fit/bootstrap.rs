//! Sessions as the bootstrap draws them, for the peers to refit.

use ramphold::fit::{NoiseSampler, RefitSearch, draw_observations, predictions};
use ramphold::random::Stream;
use serde_json::{Value, json};

use crate::problem::{Problem, measured};

/// Seed of the bootstrap.
pub const SEED: u64 = 1;

/// The first sessions that the bootstrap draws, where their refits start, and what ours come to.
pub fn as_json(problem: &Problem, count: usize) -> Value {
    let (prepared, fit) = (&problem.prepared, &problem.fit);
    let predicted: Vec<Vec<f64>> = predictions(prepared, fit).into_iter().map(|own| own.torque_nm).collect();
    let noise = NoiseSampler::new(&fit.residual_covariances);
    let search = RefitSearch::new(prepared, fit);
    let refit = |number| {
        let mut stream = Stream::new(SEED, &format!("fit/bootstrap/{number}"));
        let session = draw_observations(prepared, &predicted, &noise, &mut stream);
        let refitted = search.refit(&session);
        let costs: Vec<f64> = refitted.solution.outcomes.iter().map(|outcome| outcome.cost).collect();
        json!({ "measured_nm": measured(&session), "costs": costs })
    };
    json!({ "start": fit.solution.coordinates, "drawn": (0..count).map(refit).collect::<Vec<_>>() })
}
