//! The bootstrap that is timed: weighed refits of sessions drawn from the weighed fit, for ours and the
//! peers alike.

use nalgebra::{DMatrix, DVector};
use ramphold::fit::{Effort, Fit, Model, Objective, Prepared, Solution, predictions, solve};
use ramphold::random::Stream;
use rayon::prelude::*;
use serde_json::{Value, json};

use crate::problem::{Problem, cost, measured};

const SEED: u64 = 1;

/// A refit starts in the optimum that its data came from, so few steps lead to its own.
const REFIT: Effort = Effort { iterations: 30, decrease: 1e-5, longest_step: 0.7 };

/// A session's weighed fit, and what it predicts.
pub struct Bootstrap<'a> {
    prepared: &'a Prepared,
    fit: Fit,
    predicted_nm: Vec<Vec<f64>>,
    /// The whiteners' inverses: what makes white noise like that of the holds.
    colours: Vec<DMatrix<f64>>,
}

impl<'a> Bootstrap<'a> {
    /// From the weighed optimum of `problem`.
    pub fn new(problem: &'a Problem) -> Self {
        let (prepared, weighed) = (&problem.prepared, problem.weighed.clone());
        let fit = Fit::from_guess(prepared, &Model::paper(), weighed, Vec::new(), &problem.guess);
        let predicted_nm = predictions(prepared, &fit).into_iter().map(|own| own.torque_nm).collect();
        let Objective::Whitened(whiteners) = &fit.objective else { panic!("a weighed fit") };
        let inverse = |w: &DMatrix<f64>| w.clone().pseudo_inverse(1e-12).expect("a positive cut");
        let colours = whiteners.iter().map(inverse).collect();
        Self { prepared, fit, predicted_nm, colours }
    }

    /// Draws and refits so many sessions on as many threads as there are; the sum of their costs.
    pub fn refit_all(&self, count: usize) -> f64 {
        (0..count).into_par_iter().map(|number| cost(&self.refit(&self.drawn(number)))).sum()
    }

    /// Some of the sessions, where their refits start, and where ours end.
    pub fn as_json(&self, count: usize) -> Value {
        let refit = |number| {
            let session = self.drawn(number);
            let costs: Vec<f64> = self.refit(&session).outcomes.iter().map(|outcome| outcome.cost).collect();
            json!({ "measured_nm": measured(&session), "costs": costs })
        };
        json!({ "start": self.fit.solution.coordinates, "drawn": (0..count).map(refit).collect::<Vec<_>>() })
    }

    fn refit(&self, session: &Prepared) -> Solution {
        let Fit { layout, objective, solution, .. } = &self.fit;
        solve(session, layout, &[], objective, &solution.coordinates, REFIT)
    }

    /// The session as it might have come out: the fitted model's torque with noise that the whiteners make white.
    fn drawn(&self, number: usize) -> Prepared {
        let mut stream = Stream::new(SEED, &format!("bench/bootstrap/{number}"));
        let mut session = self.prepared.clone();
        for (trial, own) in session.trials.iter_mut().enumerate() {
            let colour = &self.colours[self.prepared.noise_of[trial].expect("every trial has a hold")];
            let noise = colour * DVector::from_fn(colour.ncols(), |_, _| stream.normal());
            own.measured_nm = self.predicted_nm[trial].iter().zip(&noise).map(|(t, n)| t + n).collect();
        }
        session
    }
}
