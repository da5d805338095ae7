//! The normal equations of a whole session: the trials' coordinates, what they share, the means of the conditions and the regression,
//! all at once.

use nalgebra::DVector;

use super::hierarchy::{Hierarchy, LinearPrior};
use super::trial_blocks::{TrialBlocks, normal_equations};
use crate::fit::bordered::{BorderedInverse, BorderedMatrix};
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::solver::levenberg_marquardt::Solution;

/// Largest number of joint steps between two estimates of the spreads.
const MAX_JOINT_STEPS: usize = 6;

/// Joint steps end where one decreases the cost by less.
const MIN_DECREASE: f64 = 1e-2;

/// The same where the optimum itself is wanted: a decrease of 1e-6 is a thousandth of a standard error.
const MAX_STEPS_TO_THE_END: usize = 30;
const LEAST_DECREASE: f64 = 1e-6;

/// Largest change of a logarithm in one step.
const MAX_LOG_STEP: f64 = 0.7;

/// Precision of a coordinate at a bound, which counts as known.
const AT_BOUND_PRECISION: f64 = 1e12;

/// Smallest part of a step that is tried.
const SMALLEST_PART: f64 = 0.05;

/// Gauss-Newton equations for known spreads. The unknowns are the coordinates of the fit, then the means of the conditions, then the
/// coefficients of the regression.
pub(super) struct SessionEquations {
    /// Negative logarithm of the posterior density, less what no unknown changes.
    pub cost: f64,
    gradient: DVector<f64>,
    matrix: BorderedMatrix,
}

impl SessionEquations {
    /// The equations at `fit`, whose priors are those of `hierarchy`. Coordinates at a bound count as known.
    pub(super) fn new(
        observations: &Observations,
        fit: &Fit,
        hierarchy: &Hierarchy,
        trials: &TrialBlocks,
    ) -> Self {
        let coordinates = fit.parameterisation.coordinates.len();
        let size = hierarchy.trial_variance.len();
        let count = coordinates + hierarchy.condition_means.len() * size + hierarchy.coefficients.len();
        let block_of = |(trial, own): (usize, &Vec<usize>)| {
            let first_mean = coordinates + trials.conditions[trial] * size;
            let shared = &fit.parameterisation.components[trials.blocks[trial].0].border;
            (own.clone(), shared.iter().copied().chain(first_mean..first_mean + size).collect())
        };
        let blocks: Vec<_> = trials.own.iter().enumerate().map(block_of).collect();
        let matrix = BorderedMatrix::zero(count, &blocks);
        let mut own = Self { cost: 0.0, gradient: DVector::zeros(count), matrix };
        let equations = normal_equations(observations, fit);
        for (component, equations) in fit.parameterisation.components.iter().zip(&equations) {
            own.cost += equations.cost;
            let gradient = equations.gradient(component);
            component.order().iter().zip(gradient.iter()).for_each(|(row, own_part)| {
                own.gradient[*row] += own_part;
            });
            equations.for_each_element(component, |row, column, value| own.matrix.add(row, column, value));
        }
        own.add_hierarchy(fit, hierarchy, trials);
        for index in (0..coordinates).filter(|index| fit.coordinate_at_bound(*index)) {
            own.gradient[index] = 0.0;
            own.matrix.isolate(index, AT_BOUND_PRECISION);
        }
        own
    }

    /// What the means and the regression add. The trials' coordinates have their priors already.
    fn add_hierarchy(&mut self, fit: &Fit, hierarchy: &Hierarchy, trials: &TrialBlocks) {
        let size = hierarchy.trial_variance.len();
        let coordinates = fit.parameterisation.coordinates.len();
        let mean = |condition: usize, place: usize| coordinates + condition * size + place;
        let first_coefficient = mean(hierarchy.condition_means.len(), 0);
        let mut priors: Vec<LinearPrior> = Vec::new();
        for (condition, regressors) in hierarchy.regressors().iter().enumerate() {
            for place in 0..size {
                let expected: f64 =
                    (0..3).map(|a| regressors[a] * hierarchy.coefficients[a * size + place]).sum();
                let mut terms = vec![(mean(condition, place), 1.0)];
                terms.extend((0..3).map(|a| (first_coefficient + a * size + place, -regressors[a])));
                priors.push(LinearPrior {
                    terms,
                    deviation: hierarchy.condition_means[condition][place] - expected,
                    precision: 1.0 / hierarchy.condition_variance[place],
                });
            }
        }
        priors.extend(hierarchy.coefficient_priors().into_iter().map(|mut own| {
            own.terms.iter_mut().for_each(|(index, _)| *index += first_coefficient);
            own
        }));
        for LinearPrior { terms, deviation, precision } in priors {
            self.cost += 0.5 * precision * deviation * deviation;
            for (one, factor) in &terms {
                self.gradient[*one] += precision * factor * deviation;
                for (other, by) in &terms {
                    self.matrix.add(*one, *other, precision * factor * by);
                }
            }
        }
        for (trial, (own, condition)) in trials.own.iter().zip(&trials.conditions).enumerate() {
            let precision = hierarchy.prior_precision(trial);
            for (place, coordinate) in own.iter().enumerate() {
                let mean = mean(*condition, place);
                let deviation =
                    fit.solution.coordinates[*coordinate] - hierarchy.condition_means[*condition][place];
                self.gradient[mean] -= precision[place] * deviation;
                self.matrix.add(mean, mean, precision[place]);
                self.matrix.add(*coordinate, mean, -precision[place]);
            }
        }
    }

    /// The Gauss-Newton step, shortened where a logarithm would change too much; `None` if the matrix is singular.
    fn step(&self) -> Option<DVector<f64>> {
        let step = -self.matrix.factor()?.solve(&self.gradient);
        let longest = step.amax();
        longest.is_finite().then(|| step * (MAX_LOG_STEP / longest).min(1.0))
    }

    /// Covariance of all unknowns; `None` if the data do not determine them.
    pub(super) fn covariance(&self) -> Option<BorderedInverse> {
        Some(self.matrix.factor()?.inverse())
    }
}

impl TrialBlocks {
    /// Brings the trials of `fit`, the means of the conditions and the regression to their joint optimum for the present spreads. Trials
    /// hold each other through what they share: one after the other they would only creep there.
    pub(super) fn settle_jointly(
        &self,
        observations: &Observations,
        fit: &mut Fit,
        hierarchy: &mut Hierarchy,
    ) {
        self.step_jointly(observations, fit, hierarchy, (MAX_JOINT_STEPS, MIN_DECREASE));
    }

    /// The same until nothing is left to gain.
    pub(super) fn settle_to_the_end(
        &self,
        observations: &Observations,
        fit: &mut Fit,
        hierarchy: &mut Hierarchy,
    ) {
        self.step_jointly(observations, fit, hierarchy, (MAX_STEPS_TO_THE_END, LEAST_DECREASE));
    }

    /// Steps towards the joint optimum: at most so many, until one decreases the cost by less.
    fn step_jointly(
        &self,
        observations: &Observations,
        fit: &mut Fit,
        hierarchy: &mut Hierarchy,
        (most, least_decrease): (usize, f64),
    ) {
        self.set_priors(fit, hierarchy);
        let mut equations = SessionEquations::new(observations, fit, hierarchy, self);
        for _ in 0..most {
            let Some(step) = equations.step() else { return };
            let mut part = 1.0;
            let moved = loop {
                let mut moved = (fit.clone(), hierarchy.clone());
                self.move_by(&mut moved.0, &mut moved.1, &(&step * part));
                let there = SessionEquations::new(observations, &moved.0, &moved.1, self);
                if there.cost < equations.cost {
                    break Some((moved, there));
                }
                part *= 0.3;
                if part < SMALLEST_PART {
                    break None;
                }
            };
            let Some(((next_fit, next_hierarchy), there)) = moved else { return };
            let decrease = equations.cost - there.cost;
            (*fit, *hierarchy, equations) = (next_fit, next_hierarchy, there);
            if decrease < least_decrease {
                return;
            }
        }
    }

    /// Moves the fit, the means and the regression by `step`, a change of all unknowns.
    pub(super) fn move_by(&self, fit: &mut Fit, hierarchy: &mut Hierarchy, step: &DVector<f64>) {
        let coordinates = fit.solution.coordinates.len();
        let all = fit.solution.coordinates.iter().zip(&fit.parameterisation.coordinates).zip(step.iter());
        let coordinates_there = all.map(|((x, own), by)| (x + by).clamp(own.low, own.high)).collect();
        let outcomes = fit.solution.outcomes.clone();
        *fit = fit.at_solution(Solution { coordinates: coordinates_there, outcomes });
        let size = hierarchy.trial_variance.len();
        for (condition, mean) in hierarchy.condition_means.iter_mut().enumerate() {
            *mean += step.rows(coordinates + condition * size, size);
        }
        let first = coordinates + hierarchy.condition_means.len() * size;
        hierarchy.coefficients += step.rows(first, 3 * size);
        self.set_priors(fit, hierarchy);
    }
}
