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
    /// Adds trials that do not belong, the cause `kind`: alone, beside the most probable other cause, and, where that is more probable than the
    /// other cause alone, beside its rivals.
    pub fn add_outliers(&mut self, kind: MechanismKind) {
        let single = self.best_with(1);
        let alone = self.models[single].log_odds;
        let is_rival = |index: &usize| {
            let own = &self.models[*index];
            let is_single = own.causes.len() == 1 && !own.causes[0].is_free_law();
            is_single && *index != single && own.log_odds > alone - NEGLIGIBLE_LOG_ODDS
        };
        let rivals: Vec<usize> = (0..self.models.len()).filter(is_rival).collect();
        self.add_outliers_beside(0, kind);
        if single > 0 && self.add_outliers_beside(single, kind).is_some_and(|log_odds| log_odds > alone) {
            for rival in rivals {
                self.add_outliers_beside(rival, kind);
            }
        }
    }

    /// Adds, beside the causes of `model`, trials that do not belong, and returns the log odds; `None` if there are none.
    fn add_outliers_beside(&mut self, model: usize, kind: MechanismKind) -> Option<f64> {
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
        let posterior = found?;
        let causes = own.causes.iter().copied().chain([kind]).collect();
        self.add(causes, posterior, outliers);
        self.models.last().map(|own| own.log_odds)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::test_session::{fit_and_prior, session};
    use crate::fit::{Observations, PreprocessingSettings};

    /// Beside a low-pass an outlier had a probability of 0.82, since the delay that could be in its place had none beside it.
    #[test]
    fn a_trial_that_does_not_belong_does_not_belong_beside_a_rival_of_the_best_cause_either() {
        let (lag, skew, outlier) =
            (MechanismKind::TorqueLag, MechanismKind::ChannelSkew, MechanismKind::OutlierTrial);
        let mut session = session(lag, |_| vec![300.0, 1.0]);
        let other = &mut session.trials[4];
        let number = other.number;
        for torque_nm in &mut other.record.torque_l_nm {
            *torque_nm = 1.5 + 1.4 * (*torque_nm - 1.5);
        }
        let observations = Observations::new(&session, PreprocessingSettings::default()).unwrap();
        let (before, prior) = fit_and_prior(&observations);
        let mut search = ModelSearch::new(&observations, &before, prior, &[lag, skew, outlier]).unwrap();
        search.add_single_causes(&[lag, skew, outlier], true);
        // As probable as each other.
        let best = search.best_log_odds();
        search.models.iter_mut().skip(1).for_each(|own| own.log_odds = best);
        search.add_outliers(outlier);
        for cause in [lag, skew] {
            let pair = search.models.iter().find(|own| own.causes == [cause, outlier]).unwrap();
            let numbers: Vec<u32> =
                pair.outliers.iter().map(|own| observations.trials[*own].number).collect();
            assert_eq!(numbers, [number], "{cause:?}");
        }
    }
}
