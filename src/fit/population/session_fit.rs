//! The fit of a session as a whole: each trial's parameters with the model of the session as their prior.

use super::convergence::Converged;
use super::hierarchy::{Hierarchy, largest_spread};
use super::no_session_model::NoSessionModel;
use super::other_optimum::OtherOptimum;
use super::session_equations::SessionEquations;
use super::session_place::SessionPlace;
use super::trial_blocks::TrialBlocks;
use super::trial_groups::TrialGroups;
use crate::fit::bordered::BorderedInverse;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::predictions;
use crate::fit::residuals::residual_covariance::angle_error_ratio;
use crate::fit::search::multistart::Restart;
use crate::statistics::f_tail;
use crate::wrist::BASE_PARAMETERS;

/// Variance of the torque error from the angle, beside that of the torque's noise, above which it is most of the error.
const LARGEST_ANGLE_ERROR: f64 = 1.0;

/// That the error of the recorded angle is most of the torque's error in `fit`, if it is.
pub fn coarse_angle(observations: &Observations, fit: &Fit) -> Option<NoSessionModel> {
    let ratio = angle_error_ratio(observations, &fit.residual_covariances);
    (ratio > LARGEST_ANGLE_ERROR)
        .then_some(NoSessionModel::CoarseAngle { ratio, step_rad: observations.angle_step_rad })
}

/// Probability with which a sound session is taken to be one whose fit went wrong.
const LEAVES_MORE_LEVEL: f64 = 1e-4;

/// Restarts of the whole session: x_e as a fraction of the largest motor angle, k_dec as one of k_srs.
const SESSION_RESTARTS: [Restart; 2] = [(0.4, 0.6), (0.6, 0.6)];

/// Sessions of fewer conditions start at more places: their trials go wrong together.
const FEW_CONDITIONS: usize = 4;
const WIDE_RESTARTS: [Restart; 8] =
    [(0.2, 0.6), (0.3, 0.6), (0.4, 0.3), (0.4, 0.6), (0.4, 0.9), (0.5, 0.6), (0.6, 0.6), (0.8, 0.6)];

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
    /// Other places of the session as a whole that the evidence does not rule out.
    pub other_places: Vec<SessionPlace>,
    /// The best division of the trials into two groups, however weak.
    pub groups: Option<TrialGroups>,
    /// Covariance of the fit's coordinates, each trial being near its most probable optimum.
    covariance: BorderedInverse,
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
        if let Some(reason) = coarse_angle(observations, independent) {
            return Err(reason);
        }
        let found = Self::so_far(observations, independent, trials)?;
        if found.leaves_more_than_trials_alone(observations, independent) {
            return Err(NoSessionModel::LeavesMore);
        }
        if let Some(groups) = found.groups.as_ref().filter(|groups| groups.are_distinct()) {
            let (place, difference) = groups.largest_difference();
            return Err(NoSessionModel::TwoGroups {
                smaller: groups.smaller.iter().map(|place| observations.trials[*place].number).collect(),
                trials: observations.trials.len(),
                parameter: BASE_PARAMETERS[found.parameters[place]],
                difference,
            });
        }
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
        let mut ends = vec![trials.converge(observations, fit, alone, points)?];
        // Most trials may have gone wrong alike: the session starts elsewhere as well.
        let restarts: &[Restart] =
            if trials.log_conditions.len() < FEW_CONDITIONS { &WIDE_RESTARTS } else { &SESSION_RESTARTS };
        for restart in restarts {
            let means = trials.restart_means(observations, independent, *restart);
            let points = vec![Vec::new(); trials.own.len()];
            let start = start.clone().about(means);
            ends.extend(trials.converge(observations, independent.clone(), start, points).ok());
        }
        ends.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        let mut best = ends.remove(0);
        let equations = SessionEquations::new(observations, &best.fit, &best.hierarchy, &trials);
        let covariance = equations.covariance().ok_or(NoSessionModel::NotFinite)?;
        let other_places = trials.other_places(&best, ends, &covariance);
        let mut points = vec![Vec::new(); trials.own.len()];
        let summaries = trials.summaries(observations, &mut best.fit.clone(), &mut points);
        let groups = TrialGroups::of(&best.hierarchy, &summaries);
        trials.move_to_medians(observations, &mut best.fit, &mut best.hierarchy, &covariance);
        let Converged { fit, hierarchy, .. } = best;
        let mut other_optima = trials.other_optima(&fit, &hierarchy);
        trials.add_places(&fit, &other_places, &mut other_optima);
        let TrialBlocks { parameters, conditions, .. } = trials;
        Ok(Self { fit, hierarchy, parameters, conditions, other_optima, other_places, groups, covariance })
    }

    /// Whether this fit leaves more of the torque than one that has the true parameters of each trial would, beside `independent`: by the
    /// F statistic, since misfit of the model and of the noise is in both.
    fn leaves_more_than_trials_alone(&self, observations: &Observations, independent: &Fit) -> bool {
        let [together, alone] = [&self.fit, independent].map(|fit| {
            let trials = predictions(observations, fit).into_iter().enumerate();
            let whitened = trials
                .map(|(trial, own)| fit.objective.whiten(observations.noise_index[trial], &own.residual_nm));
            whitened.fold((0.0, 0), |(squares, count), own| (squares + own.norm_squared(), count + own.len()))
        });
        let unknowns = independent.parameterisation.coordinates.len() as f64;
        let freedom = alone.1 as f64 - unknowns;
        let statistic = (together.0 - alone.0) / unknowns / (alone.0 / freedom);
        tracing::debug!(statistic, unknowns, freedom, "squares that the session leaves beside its trials");
        // Squares that are no numbers leave more as well.
        !(freedom > 0.0 && f_tail(statistic.max(0.0), [unknowns, freedom]) >= LEAVES_MORE_LEVEL)
    }

    /// This fit to the same session with other constants of the rig, from its optimum; the spreads stay.
    pub fn refitted_to(&self, observations: &Observations) -> Result<Self, NoSessionModel> {
        let mut moved = self.clone();
        let trials = TrialBlocks::of(observations, &self.fit)?;
        trials.settle_to_the_end(observations, &mut moved.fit, &mut moved.hierarchy);
        Ok(moved)
    }

    /// Covariance of the logarithms of a base parameter in two trials, given all trials; `None` where it is not estimated on a
    /// logarithmic scale.
    pub fn log_covariance(&self, parameter: usize, one: usize, other: usize) -> Option<f64> {
        let place = |trial: usize| self.fit.parameterisation.logarithmic_coordinate(trial, parameter);
        let (one_place, other_place) = (place(one)?, place(other)?);
        let own = self.parameters.iter().position(|own| *own == parameter).filter(|_| one == other);
        let between_optima = own.map_or(0.0, |own| self.hierarchy.trials[one].variance_between_optima(own));
        let between_places = self.covariance_between_places(one_place, other_place);
        Some(self.covariance.at(one_place, other_place) + between_optima + between_places)
    }

    /// What the other places of the session add to the covariance of two coordinates.
    fn covariance_between_places(&self, one: usize, other: usize) -> f64 {
        let here = &self.fit.solution.coordinates;
        let (mut product, mut means) = (0.0, [0.0; 2]);
        for place in &self.other_places {
            let by = [one, other].map(|index| place.coordinates[index] - here[index]);
            product += place.probability * by[0] * by[1];
            means = [0, 1].map(|own| means[own] + place.probability * by[own]);
        }
        product - means[0] * means[1]
    }
}
