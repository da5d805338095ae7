//! The fits of the trials so far: of each trial the latest estimate, and the conditions of the trials that count.

use std::collections::{BTreeMap, BTreeSet};

use super::fitter::{SessionSoFar, TrialFit, TrialFitOutcome};
use crate::fit::{ConditionEstimate, TrialEstimate, conditions_with};

/// Fits of the trials so far.
#[derive(Debug, Default)]
pub struct TrialFits {
    outcomes: BTreeMap<u32, TrialFitOutcome>,
    /// Numbers of the trials whose fit is under way.
    awaited: BTreeSet<u32>,
    /// The latest fit of several trials together.
    latest: Option<SessionSoFar>,
}

impl TrialFits {
    /// Notes that the fit of a trial is under way.
    pub fn await_trial(&mut self, number: u32) {
        self.awaited.insert(number);
    }

    /// Adds the outcome of a fit.
    pub fn add(&mut self, mut outcome: TrialFitOutcome) {
        self.awaited.remove(&outcome.0);
        // Taken out, so that not every trial keeps the covariance of all trials before it.
        if let (_, Ok(fit)) = &mut outcome
            && let Some(session) = fit.session.take()
        {
            self.latest = Some(session);
        }
        self.outcomes.insert(outcome.0, outcome);
    }

    /// Gives up the fits that are under way, for a reason.
    pub fn give_up(&mut self, reason: &str) {
        for number in std::mem::take(&mut self.awaited) {
            self.outcomes.insert(number, (number, Err(reason.to_owned())));
        }
    }

    /// Whether a fit is under way.
    pub fn are_awaited(&self) -> bool {
        !self.awaited.is_empty()
    }

    /// Whether there is an outcome for a trial.
    pub fn has(&self, number: u32) -> bool {
        self.outcomes.contains_key(&number)
    }

    /// The fit of a trial when it ended, or why there is none.
    pub fn outcome(&self, number: u32) -> Option<Result<&TrialFit, &str>> {
        self.outcomes.get(&number).map(|(_, outcome)| outcome.as_deref().map_err(String::as_str))
    }

    /// The latest estimate of a trial: of the last fit that it was a part of.
    pub fn estimate(&self, number: u32) -> Option<&TrialEstimate> {
        let own = self.outcome(number)?.ok()?;
        Some(self.latest.as_ref().and_then(|latest| latest.estimate(number)).unwrap_or(&own.estimate))
    }

    /// Whether the latest estimates are those of trials fitted together.
    pub fn are_together(&self) -> bool {
        self.latest.is_some()
    }

    /// Means by condition of the trials with these numbers.
    pub fn conditions(&self, numbers: impl Iterator<Item = u32>) -> Vec<ConditionEstimate> {
        let mut estimates: Vec<TrialEstimate> =
            numbers.filter_map(|number| self.estimate(number)).cloned().collect();
        estimates.sort_by(|a, b| {
            let torque = a.torque_nm.total_cmp(&b.torque_nm);
            torque.then(a.velocity_rad_s.total_cmp(&b.velocity_rad_s)).then(a.trial.cmp(&b.trial))
        });
        conditions_with(&estimates, |parameter, one, other| {
            let (a, b) = (&estimates[one], &estimates[other]);
            let together = self.latest.as_ref().and_then(|latest| {
                a.determined[parameter].then(|| latest.log_covariance(parameter, a.trial, b.trial)).flatten()
            });
            match (together, one == other) {
                (Some(covariance), _) => Some(covariance),
                (None, true) => a.se[parameter].map(|se| se * se),
                // Trials that were not fitted together have errors of their own.
                (None, false) => Some(0.0),
            }
        })
    }
}
