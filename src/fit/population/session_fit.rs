//! The fit of a session as a whole: each trial's parameters with the model of the session as their prior.

use nalgebra::{DMatrix, DVector};

use super::hierarchy::{Hierarchy, RatioPrior, TrialPosterior, TrialSummary, largest_spread};
use super::summary::OptimumSummary;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::uncertainty::coordinate_covariances;
use crate::fit::fitted::warm_start::WARM_START;
use crate::fit::model::parameter_index::{K_DEC, K_SRS};
use crate::fit::model::specification::Scope;
use crate::fit::parameters::coordinate::Transform;
use crate::fit::parameters::starting_values::median;
use crate::fit::residuals::objective::Objective;
use crate::fit::residuals::residual_covariance::angle_error_ratio;
use crate::fit::search::multistart::Restart;
use crate::fit::solver::levenberg_marquardt::{Solution, solve};
use crate::fit::solver::normal_equations::{GaussNewtonEquations, evaluate};
use crate::wrist::BASE_PARAMETERS;

/// Largest number of rounds: each fits all trials with the present prior, and estimates the prior anew.
const MAX_SESSION_ROUNDS: usize = 6;

/// A round ends the search where no prior mean moved by more than this part of its standard deviation.
const MEAN_TOLERANCE: f64 = 0.1;

/// Two optima of a trial are the same if they are less than this many standard deviations apart.
const SAME_OPTIMUM_SDS: f64 = 1.0;

/// Restarts of the whole session: x_e as a fraction of the largest motor angle, k_dec as one of k_srs.
const SESSION_RESTARTS: [Restart; 2] = [(0.4, 0.6), (0.6, 0.6)];

/// Rounds with the correction of skewness, after the others: it is of second order, and needs the first.
const SKEWNESS_ROUNDS: usize = 2;

/// Variance of the torque error from the angle, beside that of the torque's noise, above which it is most of the error.
const LARGEST_ANGLE_ERROR: f64 = 1.0;

/// Largest step, on a logarithmic scale, over which the skewness of a likelihood is taken.
const LARGEST_STEP: f64 = 0.3;

/// Optima of a smaller probability are given up.
const LEAST_PROBABILITY: f64 = 1e-4;

/// Why a session has no model of its own: each trial is fitted independently.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum NoSessionModel {
    /// The user asked for independent fits.
    #[error("as asked")]
    NotAsked,
    /// Without the covariance of the noise, nobody knows what a trial's torque is worth beside what the others say.
    #[error("the noise of the torque is not known from holds, or not used as a weight")]
    UnknownNoise,
    /// Parameters are shared or given by a law already.
    #[error("in this model a trial has no parameters of its own")]
    OtherModel,
    /// The spread of the trials cannot be told from that of the conditions.
    #[error("no condition was repeated")]
    NoRepetitions,
    /// The derivatives of the model rest on the recorded angle: where its error outweighs the noise, all trials are biased alike.
    #[error(
        "the error of the recorded angle (steps of {:.2} mrad) has {ratio:.1} times the variance of the torque's noise: parameters are \
         biased beyond their errors (I_j and x_e too low, k_h and k_srs too high); measure with a finer encoder",
        1e3 * step_rad
    )]
    CoarseAngle {
        /// Variance of the torque error from the angle, by that of the torque's own noise.
        ratio: f64,
        /// Step of the encoder, rad.
        step_rad: f64,
    },
    /// There is no regression.
    #[error("there is only one condition")]
    OneCondition,
    /// The trials are not those of one person, or not of this model.
    #[error(
        "{parameter} spreads by {:.0} % about its regression on velocity and torque, where one person's spreads by at most {:.0} %: \
         trials of several persons or rigs, or a model that does not describe them",
        100.0 * spread, 100.0 * most
    )]
    SpreadBeyondPerson {
        /// Name of the parameter.
        parameter: &'static str,
        /// Standard deviation of its logarithm.
        spread: f64,
        /// The largest that is taken to be one person's.
        most: f64,
    },
    /// The approximation of the likelihood is not finite.
    #[error("the trials' likelihood cannot be approximated")]
    NotFinite,
}

/// Another optimum of a trial.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct OtherOptimum {
    /// The six base parameters.
    pub values: [f64; 6],
    /// Its probability, given all trials.
    pub probability: f64,
}

/// The fit of a session with the model of its population of trials.
#[derive(Debug, Clone)]
pub struct SessionFit {
    /// The fit: each trial at its most probable optimum, with the session's prior.
    pub fit: Fit,
    /// Regression and spreads.
    pub hierarchy: Hierarchy,
    /// The parameters that the hierarchy describes, in its order: indices among the base parameters.
    pub parameters: Vec<usize>,
    /// Index of each trial's condition in the hierarchy.
    pub conditions: Vec<usize>,
    /// For each trial, its less probable optima, the most probable of them first.
    pub other_optima: Vec<Vec<OtherOptimum>>,
    shared: SharedCovariance,
}

/// Where the rounds of one start ended.
struct Converged {
    fit: Fit,
    hierarchy: Hierarchy,
    points: Vec<Vec<DVector<f64>>>,
    /// Negative logarithm of the evidence.
    cost: f64,
}

/// The trials of a fit as the hierarchy sees them.
struct TrialBlocks {
    /// For each trial, its block.
    blocks: Vec<BlockIndex>,
    /// For each trial, the indices of its coordinates.
    own: Vec<Vec<usize>>,
    parameters: Vec<usize>,
    conditions: Vec<usize>,
    log_conditions: Vec<[f64; 2]>,
}

impl SessionFit {
    /// Fits the session of `independent` as a whole, from the optima of its trials.
    ///
    /// # Errors
    /// Why the session has no model of its own.
    pub fn new(observations: &Observations, independent: &Fit) -> Result<Self, NoSessionModel> {
        let mut conditions: Vec<usize> = observations.trials.iter().map(|trial| trial.condition).collect();
        conditions.sort_unstable();
        conditions.dedup();
        if conditions.len() < 2 {
            return Err(NoSessionModel::OneCondition);
        }
        if conditions.len() == observations.trials.len() {
            return Err(NoSessionModel::NoRepetitions);
        }
        let trials = TrialBlocks::of(observations, independent)?;
        let ratio = angle_error_ratio(observations, &independent.residual_covariances);
        if ratio > LARGEST_ANGLE_ERROR {
            return Err(NoSessionModel::CoarseAngle { ratio, step_rad: observations.angle_step_rad });
        }
        let found = Self::so_far(observations, independent, trials)?;
        for (coordinate, parameter) in found.parameters.iter().enumerate() {
            let (spread, most) = (found.hierarchy.spread(coordinate), largest_spread());
            if spread > most {
                return Err(NoSessionModel::SpreadBeyondPerson {
                    parameter: BASE_PARAMETERS[*parameter],
                    spread,
                    most,
                });
            }
        }
        Ok(found)
    }

    /// The same for a session that is still running: the conditions need no repetitions yet.
    ///
    /// # Errors
    /// Why the session has no model of its own.
    pub fn while_running(observations: &Observations, independent: &Fit) -> Result<Self, NoSessionModel> {
        let trials = TrialBlocks::of(observations, independent)?;
        Self::so_far(observations, independent, trials)
    }

    fn so_far(
        observations: &Observations,
        independent: &Fit,
        trials: TrialBlocks,
    ) -> Result<Self, NoSessionModel> {
        let mut fit = independent.clone();
        let mut points = trials.independent_optima(&fit);
        let summaries = trials.summaries(observations, &mut fit, &mut points);
        let start = Hierarchy::new(&trials.log_conditions, &summaries, trials.ratio_prior());
        let alone = start.clone().estimate(&summaries).ok_or(NoSessionModel::NotFinite)?;
        // What the others expect may lie in an optimum that the trial alone did not find.
        for (own, condition) in points.iter_mut().zip(&trials.conditions) {
            own.push(alone.condition_means[*condition].clone());
        }
        let mut best = trials.converge(observations, fit, alone, points)?;
        // Most trials may have gone wrong alike: the session starts elsewhere as well.
        for restart in SESSION_RESTARTS {
            let means = trials.restart_means(observations, independent, restart);
            let points = vec![Vec::new(); trials.own.len()];
            let found =
                trials.converge(observations, independent.clone(), start.clone().about(means), points);
            if let Ok(found) = found
                && found.cost < best.cost
            {
                best = found;
            }
        }
        let Converged { mut fit, mut hierarchy, mut points, .. } = best;
        for _ in 0..SKEWNESS_ROUNDS {
            trials.set_priors(&mut fit, &hierarchy);
            let mut summaries = trials.summaries(observations, &mut fit, &mut points);
            trials.correct_skewness(observations, &fit, &hierarchy, &mut summaries);
            hierarchy = hierarchy.estimate(&summaries).ok_or(NoSessionModel::NotFinite)?;
            trials.adopt_most_probable(&mut fit, &hierarchy, &mut points);
        }
        trials.set_priors(&mut fit, &hierarchy);
        trials.settle(observations, &mut fit);
        trials.move_to_means(observations, &mut fit, &hierarchy);
        let other_optima = trials.other_optima(&fit, &hierarchy);
        let shared = SharedCovariance::new(observations, &fit, &hierarchy, &trials.conditions);
        let TrialBlocks { parameters, conditions, .. } = trials;
        Ok(Self { fit, hierarchy, parameters, conditions, other_optima, shared })
    }

    /// Covariance of the logarithms of a base parameter in two trials, given all trials; `None` where it is not estimated on a
    /// logarithmic scale.
    pub fn log_covariance(&self, parameter: usize, one: usize, other: usize) -> Option<f64> {
        let Some(coordinate) = self.parameters.iter().position(|own| *own == parameter) else {
            let place = |trial| self.shared.place(&self.fit, trial, parameter);
            return Some(self.shared.covariance[(place(one)?, place(other)?)]);
        };
        let covariance = if one == other {
            self.hierarchy.trials[one].covariance[(coordinate, coordinate)]
        } else if self.conditions[one] == self.conditions[other] {
            self.hierarchy.cross_covariance(self.conditions[one], one, other)[(coordinate, coordinate)]
        } else {
            return None;
        };
        Some(covariance)
    }
}

/// Covariance of the coordinates that trials share, such as I_j of a repetition, given all trials.
#[derive(Debug, Clone)]
struct SharedCovariance {
    coordinates: Vec<usize>,
    covariance: DMatrix<f64>,
}

impl SharedCovariance {
    /// What is known of the shared coordinates for known means of the conditions, and what an error of these means does to them.
    fn new(observations: &Observations, fit: &Fit, hierarchy: &Hierarchy, conditions: &[usize]) -> Self {
        let size = hierarchy.trial_variance.len();
        let count = hierarchy.condition_means.len();
        let mut means = DMatrix::zeros(count * size, count * size);
        for one in 0..count {
            for other in 0..count {
                means
                    .view_mut((one * size, other * size), (size, size))
                    .copy_from(&hierarchy.condition_covariance(one, other));
            }
        }
        let components = &fit.parameterisation.components;
        let coordinates: Vec<usize> = components.iter().flat_map(|own| own.border.clone()).collect();
        let mut through_means = DMatrix::zeros(coordinates.len(), count * size);
        let mut covariance = DMatrix::zeros(coordinates.len(), coordinates.len());
        let mut first = 0;
        let alone = coordinate_covariances(observations, fit, &[]).unwrap_or_default();
        for (component, own) in components.iter().zip(&alone) {
            let (border, border_start) = (component.border.len(), own.nrows() - component.border.len());
            covariance
                .view_mut((first, first), (border, border))
                .copy_from(&own.view((border_start, border_start), (border, border)));
            let mut block_start = 0;
            for (block, coordinates) in component.blocks.iter().enumerate() {
                for trial in component.trials_of_block(block) {
                    let precision = DMatrix::from_diagonal(&hierarchy.prior_precision(trial));
                    let of_trial = own.view((border_start, block_start), (border, size)) * precision;
                    let mut part = through_means.view_mut((first, conditions[trial] * size), (border, size));
                    part += of_trial;
                }
                block_start += coordinates.len();
            }
            first += border;
        }
        covariance += &through_means * means * through_means.transpose();
        Self { coordinates, covariance }
    }

    fn place(&self, fit: &Fit, trial: usize, parameter: usize) -> Option<usize> {
        match fit.parameterisation.transforms[trial][parameter] {
            Transform::Logarithmic { coordinate, .. } => {
                self.coordinates.iter().position(|own| *own == coordinate)
            }
            _ => None,
        }
    }
}

impl TrialBlocks {
    fn of(observations: &Observations, fit: &Fit) -> Result<Self, NoSessionModel> {
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

    /// The paper finds k_dec below k_srs in all conditions (3.2, 3.3), without figures.
    fn ratio_prior(&self) -> Option<RatioPrior> {
        let coordinate = |parameter: usize| self.parameters.iter().position(|own| *own == parameter);
        Some(RatioPrior { coordinates: [coordinate(K_DEC)?, coordinate(K_SRS)?], median: 0.6, log_sd: 0.5 })
    }

    /// Rounds from `hierarchy`: each fits all trials with the present prior, and estimates the prior anew.
    fn converge(
        &self,
        observations: &Observations,
        mut fit: Fit,
        mut hierarchy: Hierarchy,
        mut points: Vec<Vec<DVector<f64>>>,
    ) -> Result<Converged, NoSessionModel> {
        let mut cost = f64::INFINITY;
        for _ in 0..MAX_SESSION_ROUNDS {
            let before = hierarchy.condition_means.clone();
            self.set_priors(&mut fit, &hierarchy);
            let summaries = self.summaries(observations, &mut fit, &mut points);
            hierarchy = hierarchy.estimate(&summaries).ok_or(NoSessionModel::NotFinite)?;
            cost = hierarchy.negative_log_evidence(&summaries).ok_or(NoSessionModel::NotFinite)?;
            let has_changed = self.adopt_most_probable(&mut fit, &hierarchy, &mut points);
            let moved = before.iter().zip(&hierarchy.condition_means).flat_map(|(before, now)| {
                (0..now.len()).map(|i| (now[i] - before[i]).abs() / libm::sqrt(hierarchy.trial_variance[i]))
            });
            if !has_changed && moved.fold(0.0, f64::max) < MEAN_TOLERANCE {
                break;
            }
        }
        Ok(Converged { fit, hierarchy, points, cost })
    }

    /// Means of the conditions at a restart: k_srs, k_dec and x_e as given there, the other parameters as in the median trial.
    fn restart_means(&self, observations: &Observations, fit: &Fit, restart: Restart) -> Vec<DVector<f64>> {
        let restarted: Vec<[(usize, f64); 3]> =
            (0..self.own.len()).map(|trial| fit.restart_values(observations, trial, restart)).collect();
        let coordinate = |condition: usize, parameter: usize| {
            let of_trial = |trial: usize| {
                let other = restarted[trial].iter().find(|(own, _)| *own == parameter);
                other.map_or(fit.parameters[trial][parameter], |(_, value)| *value)
            };
            let is_fixed = restarted[0].iter().all(|(own, _)| *own != parameter);
            let members =
                (0..self.own.len()).filter(|trial| is_fixed || self.conditions[*trial] == condition);
            libm::log(median(&members.map(of_trial).collect::<Vec<_>>()))
        };
        (0..self.log_conditions.len())
            .map(|condition| {
                let own = self.parameters.iter().map(|parameter| coordinate(condition, *parameter));
                DVector::from_iterator(self.parameters.len(), own)
            })
            .collect()
    }

    /// The optima that each trial has alone.
    fn independent_optima(&self, fit: &Fit) -> Vec<Vec<DVector<f64>>> {
        (0..self.own.len())
            .map(|trial| {
                let others = fit.other_optima.iter().filter(|other| other.trials.contains(&trial));
                others.map(|other| DVector::from_column_slice(&other.coordinates)).collect()
            })
            .collect()
    }

    /// Gives each trial the prior of its condition.
    fn set_priors(&self, fit: &mut Fit, hierarchy: &Hierarchy) {
        for (trial, own) in self.own.iter().enumerate() {
            for (position, coordinate) in own.iter().enumerate() {
                let prior = hierarchy.prior(trial, self.conditions[trial], position);
                fit.parameterisation.coordinates[*coordinate].prior = Some(prior);
            }
        }
    }

    /// Brings `fit` to the optimum of its priors, and the other `points` of each trial to theirs; the summaries of all of them, the
    /// present optimum of `fit` first. `points` gets the optima in the order of the summaries.
    fn summaries(
        &self,
        observations: &Observations,
        fit: &mut Fit,
        points: &mut [Vec<DVector<f64>>],
    ) -> Vec<TrialSummary> {
        self.settle(observations, fit);
        let equations = normal_equations(observations, fit);
        let order: Vec<usize> = (0..self.own.len()).collect();
        let mut summaries: Vec<TrialSummary> = order
            .iter()
            .map(|trial| {
                let (component, block) = self.blocks[*trial];
                let of_component = &fit.parameterisation.components[component];
                let others = equations[component].border_prior_from_others(
                    of_component,
                    block,
                    &fit.solution.coordinates,
                );
                let own = &self.own[*trial];
                let at = own.iter().map(|index| fit.solution.coordinates[*index]).collect();
                let summary = OptimumSummary::new(
                    &equations[component],
                    block,
                    &others,
                    &fit.parameterisation,
                    own,
                    at,
                );
                TrialSummary { condition: self.conditions[*trial], optima: vec![summary] }
            })
            .collect();
        // By component and block, since a block must occur consecutively.
        let mut starts: Vec<(BlockIndex, usize, DVector<f64>)> = Vec::new();
        for (trial, own) in points.iter_mut().enumerate() {
            for point in own.drain(..) {
                if !is_same(&summaries[trial].optima[0], &point) {
                    starts.push((self.blocks[trial], trial, point));
                }
            }
        }
        starts.sort_by_key(|(block, ..)| *block);
        self.add_optima(observations, fit, &equations, &starts, &mut summaries);
        for (own, summary) in points.iter_mut().zip(&summaries) {
            *own = summary.optima.iter().map(|optimum| optimum.at.clone()).collect();
        }
        summaries
    }

    /// Optimises all trials together from where they are.
    fn settle(&self, observations: &Observations, fit: &mut Fit) {
        let start = fit.solution.coordinates.clone();
        let solution =
            solve(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &start, WARM_START);
        *fit = fit.at_solution(solution);
    }

    /// Adds the optima that the trials reach from `starts`, as far as they are new.
    fn add_optima(
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

    /// Corrects the summary of each trial's present optimum for the skewness of its likelihood: a quadratic about the optimum gives its
    /// mode, and the modes of many trials together are biased where their information depends on the parameters.
    ///
    /// The mean lies where the gradient of cost + 1/2 log |A| is zero, with A the second derivatives (Laplace's method, one order
    /// further: Tierney and Kadane 1986). With r the whitened residuals, J their derivatives and C the covariance, that gradient is half
    /// the contraction of the third derivatives with C; the part with r itself is left out, as in the Gauss-Newton matrix.
    fn correct_skewness(
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
    fn move_to_means(&self, observations: &Observations, fit: &mut Fit, hierarchy: &Hierarchy) {
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

    /// Puts each trial of `fit` on its most probable optimum, and drops the optima that are too improbable to matter. Returns whether a
    /// trial moved.
    fn adopt_most_probable(
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
    fn other_optima(&self, fit: &Fit, hierarchy: &Hierarchy) -> Vec<Vec<OtherOptimum>> {
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
fn normal_equations(observations: &Observations, fit: &Fit) -> Vec<GaussNewtonEquations> {
    let components: Vec<_> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at)
}
