//! A first look at a session, before any model of it.

use super::starting_values::{Guess, looks};
use crate::fit::data::preprocessing::Prepared;
use crate::fit::fitted::fit::{Weighting, objective};
use crate::fit::model::specification::Model;
use crate::fit::solver::normal_equations::Objective;

/// What first guesses are made from, whatever the model: the pilot's best points, and weights that go with them.
pub struct FirstLook {
    points: Vec<[f64; 6]>,
    objective: Objective,
}

impl FirstLook {
    /// Looks at a session.
    pub fn new(prepared: &Prepared, weighting: Weighting) -> Self {
        let points = looks(prepared);
        let (objective, _) = objective(prepared, weighting, points.first());
        Self { points, objective }
    }

    /// First guesses of `model`, the best first.
    pub(in crate::fit) fn guesses(&self, prepared: &Prepared, model: &Model) -> Vec<Guess> {
        Guess::pooled(prepared, &self.objective, &self.points, model)
    }
}
