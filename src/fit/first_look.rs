//! A first look at a session, before any model of it.

use super::guess::{Guess, looks};
use super::model::Model;
use super::normal::Objective;
use super::prepare::Prepared;
use super::run::{Weighting, objective};

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
    pub(super) fn guesses(&self, prepared: &Prepared, model: &Model) -> Vec<Guess> {
        Guess::pooled(prepared, &self.objective, &self.points, model)
    }
}
