//! Trials that do not belong.

use rayon::prelude::*;

use super::{ModelSearch, NEGLIGIBLE_LOG_ODDS};
use crate::diagnose::evidence::model_posterior::ModelPosterior;
use crate::wrist::mechanisms::MechanismKind;

/// Standard deviation of a trial that does not belong, by that of the others.
const OUTLIER_SDS: f64 = 10.0;

/// Number of trials, at most, that do not belong: one in four.
const TRIALS_PER_OUTLIER: usize = 4;

/// Number of steps of expectation maximisation for a trial that may not belong.
const SPREAD_STEPS: usize = 8;

impl ModelSearch<'_> {
    /// Adds, beside the causes of `model`, trials that do not belong.
    pub fn add_outliers(&mut self, model: usize, kind: MechanismKind) {
        let (observations, prior) = (self.observations, &self.prior);
        let own = &self.models[model];
        let count = observations.trials.len();
        let mut outliers: Vec<usize> = Vec::new();
        let mut best = own.posterior.log_evidence;
        let mut found: Option<ModelPosterior> = None;
        let mut spreads = own.posterior.spreads.clone();
        while (outliers.len() + 1) * TRIALS_PER_OUTLIER <= count {
            let factors = |outliers: &[usize], next: usize| {
                let of = |trial: usize| {
                    if trial == next || outliers.contains(&trial) { OUTLIER_SDS * OUTLIER_SDS } else { 1.0 }
                };
                (0..count).map(of).collect::<Vec<f64>>()
            };
            let estimates: Vec<(usize, f64)> = (0..count)
                .into_par_iter()
                .filter(|trial| !outliers.contains(trial))
                .filter_map(|trial| {
                    let mut design = own.posterior.design.clone();
                    design.variance_factor = factors(&outliers, trial);
                    let mut spreads = spreads.clone();
                    let (point, products) = (&own.posterior.point, &own.posterior.products);
                    let mut quadratic = design.quadratic(&spreads, point, products)?;
                    for _ in 0..SPREAD_STEPS {
                        let expected = quadratic.expected_squares(&design, &spreads, point, products);
                        spreads = expected.spreads(design.law.as_ref(), &spreads).0;
                        quadratic = design.quadratic(&spreads, point, products)?;
                    }
                    Some((trial, quadratic.log_evidence))
                })
                .collect();
            let Some((trial, estimate)) = estimates.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)) else {
                break;
            };
            // Each trial is as likely as any other not to belong.
            let penalty = libm::log(count as f64);
            if estimate - penalty < best - NEGLIGIBLE_LOG_ODDS {
                break;
            }
            let factors = factors(&outliers, trial);
            let next = own.posterior.with_variance_factors(observations, prior, &factors);
            let Some(mut next) = next else { break };
            next.log_evidence -= penalty * (outliers.len() + 1) as f64;
            if !outliers.is_empty() && next.log_evidence <= best {
                break;
            }
            best = next.log_evidence;
            spreads = next.spreads.clone();
            outliers.push(trial);
            found = Some(next);
        }
        if let Some(posterior) = found {
            let mut causes = own.causes.clone();
            causes.push(kind);
            self.add(causes, posterior, outliers);
        }
    }
}
