//! From the joint mode of a session to its median: the correction of skewness.

use nalgebra::DVector;

use super::hierarchy::Hierarchy;
use super::session_equations::SessionEquations;
use super::trial_blocks::{TrialBlocks, normal_equations};
use crate::fit::bordered::BorderedInverse;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::Fit;

/// Smallest and largest step, on a logarithmic scale, over which the skewness of a likelihood is taken; between them it is the standard
/// deviation.
const SMALLEST_STEP: f64 = 1e-5;
const LARGEST_STEP: f64 = 0.3;

/// The median of a skewed distribution lies at this part of the way from its mode to its mean (Pearson 1895).
const MEDIAN_PART: f64 = 2.0 / 3.0;

impl TrialBlocks {
    /// Moves `fit`, the means and the regression from their joint mode to the median of their posterior. `covariance` is that of all
    /// unknowns about the mode.
    ///
    /// The mode is biased where the information of the data depends on the parameters. The mean lies where the gradient of
    /// cost + 1/2 log |A| is zero, with A the second derivatives (Laplace's method, one order further: Tierney and Kadane 1986). With r
    /// the whitened residuals, J their derivatives and C the covariance, that gradient is half the contraction of the third derivatives
    /// with C; the part with r itself is left out, as in the Gauss-Newton matrix. Where this leads out of the posterior, `fit` stays at the
    /// mode.
    pub(super) fn move_to_medians(
        &self,
        observations: &Observations,
        fit: &mut Fit,
        hierarchy: &mut Hierarchy,
        covariance: &BorderedInverse,
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
            let index = self.own[trial][coordinate];
            libm::sqrt(covariance.at(index, index)).clamp(SMALLEST_STEP, LARGEST_STEP)
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
        let mut gradient = DVector::zeros(covariance.len());
        for (at, trial) in order.iter().enumerate() {
            let information = |coordinate: usize, side: usize| {
                let index = place(at, coordinate, side);
                let others = subproblems.parameterisation.components[index].border_prior.as_ref();
                others.map(|others| found[index].block_alone(0, others).2)
            };
            let own = &self.own[*trial];
            let covariance = covariance.of(own);
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
                own.iter().zip(third.iter()).for_each(|(index, third)| gradient[*index] += 0.5 * third);
            }
        }
        let change = -covariance.times(&gradient) * MEDIAN_PART;
        let (mut moved, mut moved_hierarchy) = (fit.clone(), hierarchy.clone());
        self.move_by(&mut moved, &mut moved_hierarchy, &change);
        let cost =
            |fit: &Fit, hierarchy: &Hierarchy| SessionEquations::new(observations, fit, hierarchy, self).cost;
        // On average over its posterior the cost lies above the mode's by half for each unknown. A point further up is no median: the
        // data leave something so open that one order more says nothing, and the mode is the better estimate.
        if cost(&moved, &moved_hierarchy) - cost(fit, hierarchy) < 0.5 * covariance.len() as f64 {
            (*fit, *hierarchy) = (moved, moved_hierarchy);
        }
    }
}
