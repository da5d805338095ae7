//! The causes of an answer one after the other: the fits before and after each is added, what it is worth, and what could be in its place.

use super::across_trials::covariate_regression::{covariate_effect_of, with_effect_in_parameters};
use super::across_trials::outliers::outliers;
use super::across_trials::stiffness_table::StiffnessTable;
use super::cause::{AlternativeCause, Cause, CauseEvidence};
use super::evidence::answer::{CauseProbabilities, answered_causes};
use super::evidence::found_law::LawCheck;
use super::evidence::model_search::{ComparedModel, ModelSearch};
use super::within_trial::cross_validation::gain;
use crate::fit::Fit;
use crate::statistics::chi_square_tail;
use crate::wrist::mechanisms::{EvidenceSource, MechanismKind};

/// The causes of an answer, each with the fits before and after it is added.
pub struct FitChain<'a> {
    /// The models that were compared.
    pub search: &'a ModelSearch<'a>,
    /// The probabilities of the causes.
    pub probabilities: &'a CauseProbabilities,
    /// Seed of the errors that are simulated.
    pub seed: u64,
}

impl FitChain<'_> {
    /// The causes of the model at the place `best`, the one first that explains more alone.
    pub fn causes(&self, best: usize) -> Vec<Cause> {
        let models = &self.search.models;
        let mut answered = answered_causes(models, best);
        // The cause first that explains more alone.
        let alone = |kind: MechanismKind| {
            let own = models.iter().filter(|own| own.causes == [kind]);
            own.map(|own| own.log_odds).fold(f64::NEG_INFINITY, f64::max)
        };
        answered.sort_by(|a, b| alone(b.kind).total_cmp(&alone(a.kind)));
        let whole = &models[best];
        let mut causes = Vec::new();
        let mut so_far = self.fit_of(&models[0]);
        let mut kinds = Vec::new();
        for own in answered {
            let alternatives = own
                .alternatives
                .iter()
                .map(|other| self.alternative(*other, own.kind, whole, (&kinds, &so_far)));
            let alternatives = alternatives.collect();
            kinds.push(own.kind);
            let after = self.fit_with(&kinds, whole);
            causes.push(self.cause(own.kind, alternatives, whole, &so_far, &after));
            so_far = after;
        }
        causes
    }

    /// The most probable model with exactly these causes, if one was compared. What rig trials tell in the model `whole` they tell in it.
    fn model_of(&self, kinds: &[MechanismKind], whole: &ComparedModel) -> Option<&ComparedModel> {
        let is_alike = |kind: &MechanismKind, model: &ComparedModel| {
            model.causes.contains(kind)
                && (!whole.causes.contains(kind) || model.fits(*kind) == whole.fits(*kind))
        };
        let wanted = |model: &&ComparedModel| {
            model.causes.len() == kinds.len() && kinds.iter().all(|kind| is_alike(kind, model))
        };
        self.search.models.iter().filter(wanted).max_by(|a, b| a.log_odds.total_cmp(&b.log_odds))
    }

    /// A mechanism that could be in place of the cause `of` of the model `whole`; `before` are the causes added so far, and their fit.
    fn alternative(
        &self,
        (kind, probability): (MechanismKind, f64),
        of: MechanismKind,
        whole: &ComparedModel,
        before: (&[MechanismKind], &Fit),
    ) -> AlternativeCause {
        let in_place: Vec<MechanismKind> =
            whole.causes.iter().map(|own| if *own == of { kind } else { *own }).collect();
        let values = match self.model_of(&in_place, whole) {
            Some(model) if model.fits(kind) => model.posterior.intervals(kind),
            _ => self.search.prior.rig.interval(kind).into_iter().collect(),
        };
        let added: Vec<MechanismKind> = before.0.iter().copied().chain([kind]).collect();
        let model = self.model_of(&added, whole).filter(|_| kind.evidence() == EvidenceSource::Trace);
        let fits = model.map(|model| Box::new((before.1.clone(), self.fit_of(model))));
        AlternativeCause { kind, probability, values, fits }
    }

    /// The fit of a model; what acts across the trials is in their parameters.
    fn fit_of(&self, model: &ComparedModel) -> Fit {
        self.with_effects(self.search.without_deviations(&model.posterior), &model.causes)
    }

    /// A fit with the effects across the trials of those of `kinds` that have any.
    fn with_effects(&self, fit: Fit, kinds: &[MechanismKind]) -> Fit {
        let across = kinds.iter().filter(|kind| kind.evidence() == EvidenceSource::AcrossTrials);
        across.fold(fit, |fit, kind| with_effect_in_parameters(self.search.observations(), &fit, *kind))
    }

    /// The fit of the model with the causes `kinds`, some of those of `whole`. If it was not compared, it is fitted from `whole`: the fit of
    /// another model would credit one cause with what others gain.
    fn fit_with(&self, kinds: &[MechanismKind], whole: &ComparedModel) -> Fit {
        if let Some(model) = self.model_of(kinds, whole) {
            return self.fit_of(model);
        }
        let observations = self.search.observations();
        let others = whole.causes.iter().filter(|kind| !kinds.contains(kind));
        let start = others.fold(self.search.without_deviations(&whole.posterior), |fit, kind| {
            fit.with_mechanism_removed(observations, *kind)
        });
        self.with_effects(start.extended(observations, &start.model), kinds)
    }

    fn cause(
        &self,
        kind: MechanismKind,
        alternatives: Vec<AlternativeCause>,
        whole: &ComparedModel,
        before: &Fit,
        after: &Fit,
    ) -> Cause {
        let told = if whole.fits(kind) { None } else { self.told(kind, after) };
        if let Some(told) = told {
            return Cause { alternatives, ..told };
        }
        let observations = self.search.observations();
        let others: Vec<MechanismKind> = whole.causes.iter().copied().filter(|own| *own != kind).collect();
        let without = self.model_of(&others, whole);
        let cost = |model: &ComparedModel| model.posterior.quadratic.cost;
        let chi_square_gain = gained(without.map(cost), cost(whole));
        let fitted = kind.parameters().iter().filter(|parameter| parameter.fitted).count().max(1);
        let evidence = match kind.evidence() {
            EvidenceSource::SingleTrials => {
                CauseEvidence::Outliers(outliers(observations, &whole.posterior.fit, &whole.outliers))
            }
            EvidenceSource::AcrossTrials => {
                let table = StiffnessTable::new(observations, before, &[]);
                match table.and_then(|table| covariate_effect_of(observations, before, &table, kind)) {
                    Some(effect) => CauseEvidence::AcrossTrials(effect),
                    None => self.within(before, after, chi_square_gain),
                }
            }
            _ => self.within(before, after, chi_square_gain),
        };
        Cause {
            kind,
            probability: self.probabilities.of_cause(kind),
            p_value: chi_square_gain.map(|gain| chi_square_tail(gain, fitted as f64)),
            alternatives,
            values: whole.posterior.intervals(kind),
            law: LawCheck::of(self.search, whole, kind),
            evidence,
        }
    }

    /// A cause that rig trials tell. The fit has its constant as measured, in contrast to a fit with the constant as stated.
    fn told(&self, kind: MechanismKind, fit: &Fit) -> Option<Cause> {
        let rig = &self.search.prior.rig;
        let deviation_sds = rig.deviation_sds(kind)?;
        let before = fit.refitted_to(&self.search.observations().with_constants(rig.as_stated(kind)?));
        Some(Cause {
            kind,
            probability: self.probabilities.of_cause(kind),
            p_value: Some(chi_square_tail(deviation_sds * deviation_sds, 1.0)),
            alternatives: Vec::new(),
            values: rig.interval(kind).into_iter().collect(),
            law: None,
            evidence: CauseEvidence::RigTrials {
                before: Box::new(before),
                after: Box::new(fit.clone()),
                deviation_sds,
            },
        })
    }

    fn within(&self, before: &Fit, after: &Fit, chi_square_gain: Option<f64>) -> CauseEvidence {
        let observations = self.search.observations();
        let gain = gain(observations, before, after, self.seed);
        CauseEvidence::WithinTrial {
            before: Box::new(before.clone()),
            after: Box::new(after.clone()),
            chi_square_gain,
            gain,
        }
    }
}

/// What a cause is worth in units of chi-square: twice the difference between the cost of the model without it alone, and that of the whole
/// one. `None` if the model without it was not compared.
fn gained(without: Option<f64>, whole: f64) -> Option<f64> {
    Some(2.0 * (without? - whole))
}

#[cfg(test)]
mod tests {
    use super::gained;

    #[test]
    fn a_cause_whose_reduced_model_was_not_compared_has_no_worth() {
        assert_eq!(gained(Some(120.5), 100.0), Some(41.0));
        assert_eq!(gained(None, 100.0), None);
    }
}
