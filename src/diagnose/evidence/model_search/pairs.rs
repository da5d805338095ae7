//! Models of two causes.

use rayon::prelude::*;

use super::linear_estimate::{LinearModel, ProbedChange};
use super::{ComparedModel, DEVIATION_REACH, ModelSearch, NEGLIGIBLE_LOG_ODDS};
use crate::diagnose::evidence::model_posterior::{LeastEvidence, ModelPosterior};
use crate::wrist::mechanisms::MechanismKind;

/// An estimate of the second of two causes, linear about the first, may be wrong by this part of what the second is worth.
const LINEAR_ERROR: f64 = 0.25;

/// Largest number of pairs that are fitted first, and the number of starts of each. Afterwards all others are fitted beside the causes of
/// the best.
const MAX_PAIRS: usize = 8;

const STARTS_OF_A_PAIR: usize = 2;

/// An estimate of a model of two causes, linear about that of the first.
struct PairEstimate {
    /// Logarithm of evidence and prior odds, with what the estimate may be wrong by.
    log_odds: f64,
    causes: [MechanismKind; 2],
    /// Values of the second cause's parameters.
    values: Vec<f64>,
}

impl PairEstimate {
    fn is_of(&self, causes: &[MechanismKind]) -> bool {
        causes.len() == 2 && self.causes.iter().all(|kind| causes.contains(kind))
    }

    fn is_same_pair(&self, other: &Self) -> bool {
        self.is_of(&other.causes)
    }
}

impl ModelSearch<'_> {
    /// Adds models of two causes: those that are within reach by an estimate that is linear about the first. Where the best single cause
    /// `leaves_misfit`, any other may be the first of the right pair; otherwise those that could be the cause alone.
    pub fn add_pairs(&mut self, kinds: &[MechanismKind], leaves_misfit: bool) {
        let least = self.models[self.best_with(1)].log_odds - NEGLIGIBLE_LOG_ODDS;
        let is_first = |own: &&ComparedModel| {
            own.causes.len() == 1 && !own.causes[0].is_free_law() && (leaves_misfit || own.log_odds > least)
        };
        let firsts: Vec<&ComparedModel> = self.models.iter().filter(is_first).collect();
        let mut estimates: Vec<PairEstimate> = firsts
            .par_iter()
            .filter_map(|own| Some((own, LinearModel::new(&own.posterior)?)))
            .flat_map_iter(|(own, about)| {
                let directions = self.directions(&own.posterior, kinds).into_iter();
                let others = directions.filter(|direction| direction.kind != own.causes[0]);
                let estimate = |direction: ProbedChange| {
                    let (gain, values) = self.linear_gain(&about, &direction)?;
                    let prior = self.prior_log_odds(&[direction.kind]);
                    let log_odds = own.log_odds + prior + gain + LINEAR_ERROR * gain.max(0.0);
                    Some(PairEstimate { log_odds, causes: [own.causes[0], direction.kind], values })
                };
                others.filter_map(estimate).collect::<Vec<_>>()
            })
            .collect();
        estimates.sort_by(|a, b| b.log_odds.total_cmp(&a.log_odds));
        let within_reach =
            |search: &Self, own: &PairEstimate| own.log_odds > search.best_log_odds() - NEGLIGIBLE_LOG_ODDS;
        let mut chosen: Vec<&PairEstimate> = Vec::new();
        for own in estimates.iter().filter(|own| within_reach(self, own)) {
            if chosen.iter().filter(|other| other.is_same_pair(own)).count() < STARTS_OF_A_PAIR
                && (chosen.len() < STARTS_OF_A_PAIR * MAX_PAIRS)
            {
                chosen.push(own);
            }
        }
        self.fit_pairs(&chosen);
        // What is best beside either cause of the best pair may have been estimated badly beside the other; and where a pair is the most probable
        // model, the rivals of either of its causes count only beside the other one.
        let mut searched: Vec<MechanismKind> = Vec::new();
        loop {
            let best = &self.models[self.best_with(2)];
            let is_most_probable = best.log_odds >= self.best_log_odds();
            let best = best.causes.clone();
            if best.len() != 2 || best == searched || !(leaves_misfit || is_most_probable) {
                break;
            }
            let is_beside = |own: &&PairEstimate| {
                let is_candidate = if leaves_misfit {
                    best.contains(&own.causes[0])
                } else {
                    own.causes.iter().any(|kind| best.contains(kind)) && within_reach(self, own)
                };
                is_candidate && !self.models.iter().any(|model| own.is_of(&model.causes))
            };
            let mut chosen: Vec<&PairEstimate> = Vec::new();
            for own in estimates.iter().filter(is_beside) {
                if !chosen.iter().any(|other| other.is_same_pair(own)) {
                    chosen.push(own);
                }
            }
            self.fit_pairs(&chosen);
            searched = best;
        }
    }

    /// Fits pairs from their estimated values; of several starts of a pair the best counts.
    fn fit_pairs(&mut self, chosen: &[&PairEstimate]) {
        let (observations, prior) = (self.observations, &self.prior);
        let none = &self.models[0].posterior;
        let least = self.none_evidence + DEVIATION_REACH * self.best_log_odds() - NEGLIGIBLE_LOG_ODDS;
        let least = LeastEvidence { promised: least, reached: least };
        let found: Vec<ModelPosterior> = chosen
            .par_iter()
            .filter_map(|own| {
                let first = self.models.iter().find(|model| model.causes == [own.causes[0]])?;
                let base = self.without_deviations(&first.posterior);
                let start = self.start_with(&base, own.causes[1], &own.values);
                ModelPosterior::with_exact_laws(
                    observations,
                    prior,
                    &start,
                    &own.causes,
                    Some(&none.spreads),
                    least,
                )
            })
            .collect();
        let mut plain: Vec<ModelPosterior> = Vec::new();
        for posterior in found {
            let is_same =
                |other: &&mut ModelPosterior| other.added.iter().all(|kind| posterior.added.contains(kind));
            match plain.iter_mut().find(is_same) {
                Some(other) if other.log_evidence < posterior.log_evidence => *other = posterior,
                Some(_) => {}
                None => plain.push(posterior),
            }
        }
        self.add_with_deviations(plain);
    }
}
