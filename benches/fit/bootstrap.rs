//! Sessions as the bootstrap draws them, for the peers to refit.

use ramphold::fit::{Effort, NoiseMaker, Prepared, Solution, predictions, resampled, solve};
use ramphold::random::Stream;
use serde_json::{Value, json};

use crate::problem::{Problem, measured};

/// Seed of the bootstrap.
pub const SEED: u64 = 1;

/// As `ramphold::fit::bootstrap` refits.
const REFIT: Effort = Effort { iterations: 30, decrease: 1e-5, longest_step: 0.7 };

/// The first sessions that the bootstrap draws, where their refits start, and what ours come to.
pub fn as_json(problem: &Problem, count: usize) -> Value {
    let (prepared, fit) = (&problem.prepared, &problem.fit);
    let predicted: Vec<Vec<f64>> = predictions(prepared, fit).into_iter().map(|own| own.torque_nm).collect();
    let noise = NoiseMaker::new(fit);
    let refit = |number| {
        let mut stream = Stream::new(SEED, &format!("fit/bootstrap/{number}"));
        let session = resampled(prepared, &predicted, &noise, &mut stream);
        let costs: Vec<f64> =
            refitted(problem, &session).outcomes.iter().map(|outcome| outcome.cost).collect();
        json!({ "measured_nm": measured(&session), "costs": costs })
    };
    json!({ "start": fit.solution.coordinates, "drawn": (0..count).map(refit).collect::<Vec<_>>() })
}

fn refitted(problem: &Problem, session: &Prepared) -> Solution {
    let fit = &problem.fit;
    solve(session, &fit.layout, &fit.kinds, &fit.objective, &fit.solution.coordinates, REFIT)
}
