//! The rounds of a session's fit from one start, and where else it starts.

use nalgebra::DVector;

use super::hierarchy::Hierarchy;
use super::no_session_model::NoSessionModel;
use super::trial_blocks::TrialBlocks;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::search::multistart::Restart;
use crate::statistics::upper_median;

/// Largest number of rounds: each fits all trials with the present prior, and estimates the prior anew.
const MAX_SESSION_ROUNDS: usize = 6;

/// A round ends the search where no prior mean moved by more than this part of its standard deviation.
const MEAN_TOLERANCE: f64 = 0.1;

/// Where the rounds of one start ended.
pub(super) struct Converged {
    /// Each trial at its most probable optimum.
    pub fit: Fit,
    /// Regression, spreads and posteriors.
    pub hierarchy: Hierarchy,
    /// Negative logarithm of the evidence.
    pub cost: f64,
}

impl TrialBlocks {
    /// Rounds from `hierarchy`: each fits all trials with the present prior, estimates the spreads anew, and goes to the joint optimum
    /// for these spreads.
    pub(super) fn converge(
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
            let has_settled = !has_changed && moved.fold(0.0, f64::max) < MEAN_TOLERANCE;
            self.settle_jointly(observations, &mut fit, &mut hierarchy);
            if has_settled {
                break;
            }
        }
        Ok(Converged { fit, hierarchy, cost })
    }

    /// Means of the conditions at a restart: k_srs, k_dec and x_e as given there, the other parameters as in the median trial.
    pub(super) fn restart_means(
        &self,
        observations: &Observations,
        fit: &Fit,
        restart: Restart,
    ) -> Vec<DVector<f64>> {
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
            libm::log(upper_median(members.map(of_trial)).unwrap_or(f64::NAN))
        };
        (0..self.log_conditions.len())
            .map(|condition| {
                let own = self.parameters.iter().map(|parameter| coordinate(condition, *parameter));
                DVector::from_iterator(self.parameters.len(), own)
            })
            .collect()
    }
}
