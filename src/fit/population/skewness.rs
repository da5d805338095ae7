//! From the modes of many trials to their means: the correction of skewness.

use nalgebra::DVector;

use super::hierarchy::{Hierarchy, TrialSummary};
use super::trial_blocks::{TrialBlocks, normal_equations};
use crate::fit::data::observations::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::Fit;
use crate::fit::solver::levenberg_marquardt::Solution;

/// Largest step, on a logarithmic scale, over which the skewness of a likelihood is taken.
const LARGEST_STEP: f64 = 0.3;

impl TrialBlocks {
    /// Corrects the summary of each trial's present optimum for the skewness of its likelihood: a quadratic about the optimum gives its
    /// mode, and the modes of many trials together are biased where their information depends on the parameters.
    ///
    /// The mean lies where the gradient of cost + 1/2 log |A| is zero, with A the second derivatives (Laplace's method, one order
    /// further: Tierney and Kadane 1986). With r the whitened residuals, J their derivatives and C the covariance, that gradient is half
    /// the contraction of the third derivatives with C; the part with r itself is left out, as in the Gauss-Newton matrix.
    pub(super) fn correct_skewness(
        &self,
        observations: &Observations,
        fit: &Fit,
        hierarchy: &Hierarchy,
        summaries: &mut [TrialSummary],
    ) {
        let size = self.parameters.len();
        let mut order: Vec<usize> = (0..self.own.len()).collect();
        order.sort_by_key(|trial| self.blocks[*trial]);
        let blocks: Vec<BlockIndex> =
            order.iter().flat_map(|trial| std::iter::repeat_n(self.blocks[*trial], 2 * size)).collect();
        let equations = normal_equations(observations, fit);
        let subproblems = BlockSubproblems::new(observations, fit, &equations, &blocks);
        let mut points = subproblems.start.clone();
        let step = |trial: usize, coordinate: usize| {
            libm::sqrt(hierarchy.trials[trial].covariance[(coordinate, coordinate)]).min(LARGEST_STEP)
        };
        let place = |at: usize, coordinate: usize, side: usize| 2 * (at * size + coordinate) + side;
        for (at, trial) in order.iter().enumerate() {
            for coordinate in 0..size {
                for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
                    let first = subproblems.ranges[place(at, coordinate, side)].start;
                    points[first + coordinate] += sign * step(*trial, coordinate);
                }
            }
        }
        let found = subproblems.normal_equations(&points);
        for (at, trial) in order.iter().enumerate() {
            let information = |coordinate: usize, side: usize| {
                let index = place(at, coordinate, side);
                let others = subproblems.parameterisation.components[index].border_prior.as_ref();
                others.map(|others| found[index].block_alone(0, others).2)
            };
            let covariance = &hierarchy.trials[*trial].covariance;
            let (mut whole, mut first) = (DVector::zeros(size), DVector::zeros(size));
            for coordinate in 0..size {
                let (Some(below), Some(above)) = (information(coordinate, 0), information(coordinate, 1))
                else {
                    continue;
                };
                let slope = (above - below) / (2.0 * step(*trial, coordinate));
                whole[coordinate] = covariance.component_mul(&slope).sum();
                first += slope * covariance.column(coordinate);
            }
            let third = 0.5 * whole + first;
            if third.iter().all(|value: &f64| value.is_finite()) {
                summaries[*trial].optima[0].gradient += 0.5 * third;
            }
        }
    }

    /// Moves each trial of `fit` from its optimum to the mean of its posterior, and what the trials share with them.
    pub(super) fn move_to_means(&self, observations: &Observations, fit: &mut Fit, hierarchy: &Hierarchy) {
        let equations = normal_equations(observations, fit);
        let step = |trial: usize| {
            let posterior = &hierarchy.trials[trial];
            let mean = &posterior.means[posterior.most_probable()];
            DVector::from_fn(mean.len(), |i, _| mean[i] - fit.solution.coordinates[self.own[trial][i]])
        };
        let mut coordinates = fit.solution.coordinates.clone();
        for (component, equations) in fit.parameterisation.components.iter().zip(&equations) {
            let trials: Vec<usize> =
                (0..component.blocks.len()).flat_map(|block| component.trials_of_block(block)).collect();
            let steps: Vec<DVector<f64>> = trials.iter().map(|trial| step(*trial)).collect();
            let response = equations.border_response(&steps);
            for (trial, step) in trials.iter().zip(&steps) {
                self.own[*trial].iter().zip(step.iter()).for_each(|(index, by)| coordinates[*index] += by);
            }
            component.border.iter().zip(response.iter()).for_each(|(index, by)| coordinates[*index] += by);
        }
        for (value, bounds) in coordinates.iter_mut().zip(&fit.parameterisation.coordinates) {
            *value = value.clamp(bounds.low, bounds.high);
        }
        *fit = fit.at_solution(Solution { coordinates, outcomes: fit.solution.outcomes.clone() });
    }
}
