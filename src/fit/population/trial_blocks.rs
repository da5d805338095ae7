//! The trials of a fit as the model of a session sees them: their optima under the present prior.

use nalgebra::DVector;

use super::hierarchy::{Hierarchy, RatioPrior, TrialPosterior, TrialSummary};
use super::no_session_model::NoSessionModel;
use super::other_optimum::OtherOptimum;
use super::session_priors::DECREMENT_RATIO;
use super::summary::OptimumSummary;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::warm_start::WARM_START;
use crate::fit::model::parameter_index::{K_DEC, K_SRS};
use crate::fit::model::specification::Scope;
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::levenberg_marquardt::solve;
use crate::fit::solver::normal_equations::{GaussNewtonEquations, evaluate};

/// Two optima of a trial are the same if they are less than this many standard deviations apart.
const SAME_OPTIMUM_SDS: f64 = 1.0;

/// Optima of a smaller probability are given up.
const LEAST_PROBABILITY: f64 = 1e-4;

/// The trials of a fit as the hierarchy sees them.
pub(super) struct TrialBlocks {
    /// For each trial, its block.
    pub blocks: Vec<BlockIndex>,
    /// For each trial, the indices of its coordinates.
    pub own: Vec<Vec<usize>>,
    /// The parameters that each trial has of its own.
    pub parameters: Vec<usize>,
    /// For each trial, its condition.
    pub conditions: Vec<usize>,
    /// Logarithms of velocity and torque of each condition.
    pub log_conditions: Vec<[f64; 2]>,
}

impl TrialBlocks {
    pub(super) fn of(observations: &Observations, fit: &Fit) -> Result<Self, NoSessionModel> {
        if !matches!(fit.objective, Objective::Whitened(_)) {
            return Err(NoSessionModel::UnknownNoise);
        }
        let count = observations.trials.len();
        let (mut blocks, mut own) = (vec![(0, 0); count], vec![Vec::new(); count]);
        for (component, of_component) in fit.parameterisation.components.iter().enumerate() {
            for (block, coordinates) in of_component.blocks.iter().enumerate() {
                let mut members = of_component.trials_of_block(block);
                let (Some(trial), None) = (members.next(), members.next()) else {
                    return Err(NoSessionModel::OtherModel);
                };
                blocks[trial] = (component, block);
                own[trial] = coordinates.clone();
            }
        }
        let parameters_of = |trial: &Vec<usize>| -> Vec<usize> {
            let coordinates = trial.iter().map(|index| &fit.parameterisation.coordinates[*index]);
            coordinates.filter(|own| own.logarithmic).map(|own| own.parameter).collect()
        };
        let parameters = own.first().map(parameters_of).unwrap_or_default();
        let is_alike =
            |trial: &Vec<usize>| trial.len() == parameters.len() && parameters_of(trial) == parameters;
        let is_own = |spec: &crate::fit::model::specification::ParameterSpec| {
            spec.scope == Scope::Trial && spec.law.is_empty()
        };
        let has_own = parameters.iter().all(|parameter| fit.model.base.get(*parameter).is_some_and(is_own));
        if parameters.is_empty() || !has_own || !own.iter().all(is_alike) {
            return Err(NoSessionModel::OtherModel);
        }
        let mut present: Vec<usize> = observations.trials.iter().map(|trial| trial.condition).collect();
        present.sort_unstable();
        present.dedup();
        let log_condition = |condition: &usize| {
            let trial = observations.trials.iter().find(|trial| trial.condition == *condition);
            trial.map_or([0.0; 2], |trial| {
                [trial.velocity_rad_s, trial.torque_nm].map(|size| libm::log(size.abs().max(1e-3)))
            })
        };
        let place = |condition: usize| present.binary_search(&condition).unwrap_or(0);
        Ok(Self {
            blocks,
            own,
            parameters,
            conditions: observations.trials.iter().map(|trial| place(trial.condition)).collect(),
            log_conditions: present.iter().map(log_condition).collect(),
        })
    }

    /// Prior of k_dec as a part of k_srs, if both are estimated.
    pub(super) fn ratio_prior(&self) -> Option<RatioPrior> {
        let coordinate = |parameter: usize| self.parameters.iter().position(|own| *own == parameter);
        let (median, log_sd) = DECREMENT_RATIO;
        Some(RatioPrior { coordinates: [coordinate(K_DEC)?, coordinate(K_SRS)?], median, log_sd })
    }

    /// The optima that each trial has alone.
    pub(super) fn independent_optima(&self, fit: &Fit) -> Vec<Vec<DVector<f64>>> {
        (0..self.own.len())
            .map(|trial| {
                let others = fit.other_optima.iter().filter(|other| other.trials.contains(&trial));
                others.map(|other| DVector::from_column_slice(&other.coordinates)).collect()
            })
            .collect()
    }

    /// Gives each trial the prior of its condition.
    pub(super) fn set_priors(&self, fit: &mut Fit, hierarchy: &Hierarchy) {
        for (trial, own) in self.own.iter().enumerate() {
            for (position, coordinate) in own.iter().enumerate() {
                let prior = hierarchy.prior(trial, self.conditions[trial], position);
                fit.parameterisation.coordinates[*coordinate].prior = Some(prior);
            }
        }
    }

    /// Brings `fit` to the optimum of its priors, and the other `points` of each trial to theirs; the summaries of all of them, the
    /// present optimum of `fit` first. `points` gets the optima in the order of the summaries.
    pub(super) fn summaries(
        &self,
        observations: &Observations,
        fit: &mut Fit,
        points: &mut [Vec<DVector<f64>>],
    ) -> Vec<TrialSummary> {
        self.settle(observations, fit);
        let equations = normal_equations(observations, fit);
        let with_component = equations.iter().zip(&fit.parameterisation.components);
        let others: Vec<_> = with_component
            .map(|(own, component)| own.border_priors_from_others(component, &fit.solution.coordinates))
            .collect();
        let order: Vec<usize> = (0..self.own.len()).collect();
        let mut summaries: Vec<TrialSummary> = order
            .iter()
            .map(|trial| {
                let (component, block) = self.blocks[*trial];
                let own = &self.own[*trial];
                let at = own.iter().map(|index| fit.solution.coordinates[*index]).collect();
                let summary = OptimumSummary::new(
                    &equations[component],
                    block,
                    &others[component][block],
                    &fit.parameterisation,
                    own,
                    at,
                );
                TrialSummary { condition: self.conditions[*trial], optima: vec![summary] }
            })
            .collect();
        let mut starts: Vec<(BlockIndex, usize, DVector<f64>)> = Vec::new();
        for (trial, own) in points.iter_mut().enumerate() {
            for point in own.drain(..) {
                if !is_same(&summaries[trial].optima[0], &point) {
                    starts.push((self.blocks[trial], trial, point));
                }
            }
        }
        self.add_optima(observations, fit, &equations, &starts, &mut summaries);
        for (own, summary) in points.iter_mut().zip(&summaries) {
            *own = summary.optima.iter().map(|optimum| optimum.at.clone()).collect();
        }
        summaries
    }

    /// Optimises all trials together from where they are.
    pub(super) fn settle(&self, observations: &Observations, fit: &mut Fit) {
        let start = fit.solution.coordinates.clone();
        let solution =
            solve(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &start, WARM_START);
        *fit = fit.at_solution(solution);
    }

    /// Adds the optima that the trials reach from `starts`, as far as they are new.
    pub(super) fn add_optima(
        &self,
        observations: &Observations,
        fit: &Fit,
        equations: &[GaussNewtonEquations],
        starts: &[(BlockIndex, usize, DVector<f64>)],
        summaries: &mut [TrialSummary],
    ) {
        if starts.is_empty() {
            return;
        }
        let blocks: Vec<BlockIndex> = starts.iter().map(|(block, ..)| *block).collect();
        let subproblems = BlockSubproblems::new(observations, fit, equations, &blocks);
        let mut start = subproblems.start.clone();
        for ((_, _, point), range) in starts.iter().zip(&subproblems.ranges) {
            for (offset, value) in point.iter().enumerate() {
                let bounds = &subproblems.parameterisation.coordinates[range.start + offset];
                start[range.start + offset] = value.clamp(bounds.low, bounds.high);
            }
        }
        let all: Vec<usize> = (0..starts.len()).collect();
        let solution = subproblems.solve(&subproblems.subset(&all), &start, WARM_START);
        let found = subproblems.normal_equations(&solution.coordinates);
        for (index, (_, trial, _)) in starts.iter().enumerate() {
            let first = subproblems.ranges[index].start;
            let own: Vec<usize> = (first..first + self.own[*trial].len()).collect();
            let at = own.iter().map(|place| solution.coordinates[*place]).collect();
            let component = &subproblems.parameterisation.components[index];
            let Some(others) = &component.border_prior else { continue };
            let summary =
                OptimumSummary::new(&found[index], 0, others, &subproblems.parameterisation, &own, at);
            let known = &mut summaries[*trial].optima;
            if summary.cost.is_finite() && !known.iter().any(|other| is_same(other, &summary.at)) {
                known.push(summary);
            }
        }
    }

    /// Puts each trial of `fit` on its most probable optimum, and drops the optima that are too improbable to matter. Returns whether a
    /// trial moved.
    pub(super) fn adopt_most_probable(
        &self,
        fit: &mut Fit,
        hierarchy: &Hierarchy,
        points: &mut [Vec<DVector<f64>>],
    ) -> bool {
        let mut has_moved = false;
        for (trial, (own, posterior)) in points.iter_mut().zip(&hierarchy.trials).enumerate() {
            let best = posterior.most_probable();
            if best > 0 {
                has_moved = true;
                for (coordinate, value) in self.own[trial].iter().zip(own[best].iter()) {
                    fit.solution.coordinates[*coordinate] = *value;
                }
            }
            let mut probabilities = posterior.probabilities.iter();
            own.retain(|_| probabilities.next().is_none_or(|own| *own > LEAST_PROBABILITY));
        }
        has_moved
    }

    /// The optima of each trial but the most probable one.
    pub(super) fn other_optima(&self, fit: &Fit, hierarchy: &Hierarchy) -> Vec<Vec<OtherOptimum>> {
        let of_trial = |(trial, posterior): (usize, &TrialPosterior)| {
            let best = posterior.most_probable();
            let mut others: Vec<OtherOptimum> = (0..posterior.means.len())
                .filter(|optimum| *optimum != best)
                .map(|optimum| {
                    let mut coordinates = fit.solution.coordinates.clone();
                    for (coordinate, value) in self.own[trial].iter().zip(posterior.means[optimum].iter()) {
                        coordinates[*coordinate] = *value;
                    }
                    OtherOptimum {
                        values: fit.base_values(trial, &coordinates),
                        probability: posterior.probabilities[optimum],
                    }
                })
                .collect();
            others.sort_by(|a, b| b.probability.total_cmp(&a.probability));
            others
        };
        hierarchy.trials.iter().enumerate().map(of_trial).collect()
    }
}

/// Whether a point is within the noise of an optimum.
fn is_same(optimum: &OptimumSummary, point: &DVector<f64>) -> bool {
    let by = point - &optimum.at;
    by.dot(&(&optimum.information * &by)) < SAME_OPTIMUM_SDS * SAME_OPTIMUM_SDS
}

/// Normal equations of all components at the optimum of `fit`.
pub(super) fn normal_equations(observations: &Observations, fit: &Fit) -> Vec<GaussNewtonEquations> {
    let components: Vec<_> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at)
}
