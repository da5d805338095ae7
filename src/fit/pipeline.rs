//! The pipeline of a fit: starting values, residual covariances, optimisation, multistart search.

use crate::fit::data::observations::{NoiseSource, Observations};
use crate::fit::fitted::fit::Fit;
use crate::fit::model::specification::Model;
use crate::fit::residuals::objective::{Objective, Weighting};
use crate::fit::search::starting_value_search::StartingValueSearch;
use crate::fit::solver::levenberg_marquardt::solve;
use crate::fit::solver::options::SolverOptions;

impl Fit {
    /// Fits `model` to the observations of a session.
    ///
    /// An unweighted fit starts at the optimum of the weighted fit, if the holds determine the noise: ordinary least squares has many
    /// optima that the noise does not distinguish, and this choice selects the one that the data support.
    pub fn new(observations: &Observations, model: &Model, weighting: Weighting) -> Self {
        if weighting == Weighting::Plain && observations.noise_source == Some(NoiseSource::Holds) {
            return Self::new(observations, model, Weighting::MeasuredNoise).unweighted(observations);
        }
        let search = StartingValueSearch::new(observations, weighting);
        let starting_values = search.starting_values(observations, model).swap_remove(0);
        // The pilot search determines the damping, on which the effect of an angle error depends, only roughly; the pooled fit
        // determines it well enough for the weights.
        let (objective, covariances) =
            Objective::new(observations, weighting, Some(&starting_values.median_values()));
        let mut fit =
            Self::from_starting_values(observations, model, objective, covariances, &starting_values);
        fit.search_multistart(observations);
        fit
    }

    /// This fit repeated with ordinary least squares, from its optimum.
    pub fn unweighted(mut self, observations: &Observations) -> Self {
        self.objective = Objective::LeastSquares;
        let start = &self.solution.coordinates;
        let options = SolverOptions::default();
        self.solution =
            solve(observations, &self.parameterisation, &self.kinds, &self.objective, start, options);
        self.update_parameters();
        self.search_multistart(observations);
        self
    }
}
