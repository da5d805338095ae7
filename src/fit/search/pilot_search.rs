//! A first look at a session, before any model of it.

use super::starting_values::{StartingValues, pilot_points};
use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::fit::{Weighting, objective};
use crate::fit::model::specification::Model;
use crate::fit::solver::normal_equations::Objective;

/// What first starting_values are made from, whatever the model: the pilot's best points, and weights that go with them.
pub struct PilotSearch {
    points: Vec<[f64; 6]>,
    objective: Objective,
}

impl PilotSearch {
    /// Looks at a session.
    pub fn new(observations: &Observations, weighting: Weighting) -> Self {
        let points = pilot_points(observations);
        let (objective, _) = objective(observations, weighting, points.first());
        Self { points, objective }
    }

    /// First starting_values of `model`, the best first.
    pub(in crate::fit) fn starting_values(
        &self,
        observations: &Observations,
        model: &Model,
    ) -> Vec<StartingValues> {
        StartingValues::pooled(observations, &self.objective, &self.points, model)
    }
}
