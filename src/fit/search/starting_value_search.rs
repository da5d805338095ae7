//! Search for starting values: pilot search, then pooled fits of a model from its best points.

use super::pilot_search::pilot_points;
use super::pooled_fit::pooled_starting_values;
use crate::fit::data::observations::Observations;
use crate::fit::model::specification::Model;
use crate::fit::parameters::starting_values::StartingValues;
use crate::fit::residuals::objective::{Objective, Weighting};

/// Search for starting values in one session. The pilot search does not depend on the model, so it serves several models.
pub struct StartingValueSearch {
    /// The best points of the pilot search: six base parameters, x_e in rad.
    points: Vec<[f64; 6]>,
    objective: Objective,
}

impl StartingValueSearch {
    /// Runs the pilot search on `observations`; pooled fits will weight residuals by `weighting`.
    pub fn new(observations: &Observations, weighting: Weighting) -> Self {
        let points = pilot_points(observations);
        let (objective, _) = Objective::new(observations, weighting, points.first());
        Self { points, objective }
    }

    /// Starting values of `model` for all trials, the best first.
    pub fn starting_values(&self, observations: &Observations, model: &Model) -> Vec<StartingValues> {
        pooled_starting_values(observations, &self.objective, &self.points, model)
    }
}
