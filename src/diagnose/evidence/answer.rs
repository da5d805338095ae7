//! From the probabilities of models to an answer: which causes, each with the set that it cannot be told from.

use serde_json::{Map, Value, json};

use super::model_search::ComparedModel;
use crate::random::Stream;
use crate::statistics::{largest_posterior, probabilities};
use crate::wrist::mechanisms::MechanismKind;

/// Probability that what is named must have: a cause alone, or the smallest set that holds it.
pub const NAMED_PROBABILITY: f64 = 0.95;

/// Probability of each cause.
#[derive(Debug, Clone)]
pub struct CauseProbabilities {
    /// That no cause is at work.
    pub none: f64,
    /// That a cause is at work which the catalogue does not have.
    pub none_of_these: f64,
    /// That each mechanism is at work, the most probable first.
    pub causes: Vec<(MechanismKind, f64)>,
    /// Probability of each free law, given that the cause is in no catalogue, the most probable first.
    pub free_laws: Vec<(MechanismKind, f64)>,
}

impl CauseProbabilities {
    /// The probabilities from all models.
    pub fn of(models: &[ComparedModel]) -> Self {
        let weights = weights(models);
        let sum = |wanted: &dyn Fn(&ComparedModel) -> bool| -> f64 {
            models.iter().zip(&weights).filter(|(own, _)| wanted(own)).map(|(_, weight)| weight).sum()
        };
        let mut kinds: Vec<MechanismKind> = models.iter().flat_map(|own| own.causes.clone()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        let none_of_these = sum(&|own| own.causes.iter().any(|kind| kind.is_free_law()));
        let mut causes: Vec<(MechanismKind, f64)> =
            kinds.into_iter().map(|kind| (kind, sum(&|own| own.causes.contains(&kind)))).collect();
        causes.sort_by(|a, b| b.1.total_cmp(&a.1));
        let (mut free_laws, causes): (Vec<_>, Vec<_>) =
            causes.into_iter().partition(|(kind, _)| kind.is_free_law());
        free_laws.iter_mut().for_each(|own| own.1 /= none_of_these.max(f64::MIN_POSITIVE));
        Self { none: sum(&|own| own.causes.is_empty()), none_of_these, causes, free_laws }
    }

    /// The probabilities where the test of the model as given sees no misfit, at `p_value`: the odds of a cause are at most what that allows.
    /// Before the data they are even.
    pub fn where_nothing_is_seen(self, p_value: f64) -> Self {
        let least = 1.0 - largest_posterior(0.5, p_value);
        let part = others_part(self.none, least);
        Self { none: self.none.max(least), none_of_these: part * self.none_of_these, ..self }
            .with_causes_times(part)
    }

    /// The probabilities where the test of the best model has found misfit, at `p_value`: what was compared has a model of `prior` probability
    /// beside it that was not.
    pub fn where_misfit_is_left(self, p_value: f64, prior: f64) -> Self {
        let least = largest_posterior(prior, p_value);
        let part = others_part(self.none_of_these, least);
        Self { none: part * self.none, none_of_these: self.none_of_these.max(least), ..self }
            .with_causes_times(part)
    }

    /// The probabilities where the mechanisms `sizeless` of the best model may as well have no size: what their laws explain is not theirs.
    pub fn where_law_has_no_size(mut self, sizeless: &[MechanismKind]) -> Self {
        for (kind, probability) in self.causes.iter_mut().filter(|(kind, _)| sizeless.contains(kind)) {
            tracing::debug!(?kind, probability, "no size");
            self.none_of_these = self.none_of_these.max(std::mem::take(probability));
        }
        self
    }

    fn with_causes_times(mut self, part: f64) -> Self {
        self.causes.iter_mut().for_each(|(_, probability)| *probability *= part);
        self
    }

    /// The probabilities by cause, with `none` and `none_of_these`.
    pub fn to_json(&self) -> Value {
        let mut entry: Map<String, Value> = self
            .causes
            .iter()
            .map(|(kind, probability)| (kind.id().to_string(), json!(probability)))
            .collect();
        entry.insert("none".into(), json!(self.none));
        entry.insert("none_of_these".into(), json!(self.none_of_these));
        Value::Object(entry)
    }

    /// The probability of a mechanism.
    pub fn of_cause(&self, kind: MechanismKind) -> f64 {
        self.causes.iter().find(|(own, _)| *own == kind).map_or(0.0, |(_, probability)| *probability)
    }

    /// The smallest set of free laws that holds the probability needed to name one.
    pub fn likely_free_laws(&self) -> Vec<(MechanismKind, f64)> {
        smallest_set(&self.free_laws)
    }
}

/// What is left of all others where a probability is raised to `least`.
fn others_part(probability: f64, least: f64) -> f64 {
    if probability < least { (1.0 - least) / (1.0 - probability) } else { 1.0 }
}

/// A cause of the most probable model, and what could be in its place.
#[derive(Debug, Clone)]
pub struct AnsweredCause {
    /// The cause.
    pub kind: MechanismKind,
    /// The causes that could be in its place, with their probability there, the most probable first.
    pub alternatives: Vec<(MechanismKind, f64)>,
}

/// The number of causes that the models support, and the most probable model with so many, as index.
pub fn most_probable_model(models: &[ComparedModel]) -> usize {
    let weights = weights(models);
    let in_catalogue = |own: &ComparedModel| own.causes.iter().all(|kind| !kind.is_free_law());
    let with_at_least = |count: usize| -> f64 {
        let of =
            models.iter().zip(&weights).filter(|(own, _)| in_catalogue(own) && own.causes.len() >= count);
        of.map(|(_, weight)| weight).sum()
    };
    let most = models.iter().map(|own| own.causes.len()).max().unwrap_or(0);
    let supported = |count: &usize| with_at_least(*count) >= NAMED_PROBABILITY * with_at_least(*count - 1);
    let count = (1..=most).take_while(supported).count();
    let candidates = (0..models.len())
        .filter(|index| in_catalogue(&models[*index]) && models[*index].causes.len() == count);
    candidates.max_by(|a, b| models[*a].log_odds.total_cmp(&models[*b].log_odds)).unwrap_or(0)
}

/// The most probable model of causes that are at work with more than the probability left beside what is named, as index: where the cause
/// is in no catalogue, the most probable model of the catalogue may have no probability to speak of.
pub fn most_probable_of_likely_causes(models: &[ComparedModel], probabilities: &CauseProbabilities) -> usize {
    let is_likely =
        |kind: &MechanismKind| !kind.is_free_law() && probabilities.of_cause(*kind) > 1.0 - NAMED_PROBABILITY;
    let candidates = (0..models.len()).filter(|index| models[*index].causes.iter().all(is_likely));
    candidates.max_by(|a, b| models[*a].log_odds.total_cmp(&models[*b].log_odds)).unwrap_or(0)
}

/// The causes of `models[index]`. Each has the smallest set of causes in its place that holds the probability needed, given the others.
pub fn answered_causes(models: &[ComparedModel], index: usize) -> Vec<AnsweredCause> {
    let weights = weights(models);
    let own = &models[index];
    let with_set = |kind: &MechanismKind| {
        let others: Vec<&MechanismKind> = own.causes.iter().filter(|other| *other != kind).collect();
        let mut places: Vec<(MechanismKind, f64)> = Vec::new();
        for (model, weight) in models.iter().zip(&weights) {
            let same_others = others.iter().all(|other| model.causes.contains(other));
            if !same_others || model.causes.len() != own.causes.len() {
                continue;
            }
            let in_place = model.causes.iter().find(|kind| !others.contains(kind));
            let Some(in_place) = in_place.filter(|kind| !kind.is_free_law()) else { continue };
            match places.iter_mut().find(|(kind, _)| kind == in_place) {
                Some(place) => place.1 += weight,
                None => places.push((*in_place, *weight)),
            }
        }
        let total: f64 = places.iter().map(|(_, weight)| weight).sum();
        places.iter_mut().for_each(|own| own.1 /= total.max(f64::MIN_POSITIVE));
        places.sort_by(|a, b| b.1.total_cmp(&a.1));
        let alternatives = smallest_set(&places).into_iter().filter(|(other, _)| other != kind).collect();
        AnsweredCause { kind: *kind, alternatives }
    };
    own.causes.iter().map(with_set).collect()
}

/// The first of `sorted`, until they hold the probability needed.
fn smallest_set(sorted: &[(MechanismKind, f64)]) -> Vec<(MechanismKind, f64)> {
    let mut held = 0.0;
    let mut set = Vec::new();
    for own in sorted {
        if held >= NAMED_PROBABILITY {
            break;
        }
        held += own.1;
        set.push(*own);
    }
    set
}

/// Standard deviation of the error of a cause's log evidence: of Laplace's approximation and of spreads that are estimated rather than
/// integrated out. Measured on development sessions (docs/explanation/diagnosis.md).
const EVIDENCE_SD: f64 = 2.0;

/// Number of draws of these errors.
const EVIDENCE_DRAWS: usize = 2000;

/// Probability of each model: the mean over the errors that its evidence may have. Models with the same cause share its error.
fn weights(models: &[ComparedModel]) -> Vec<f64> {
    let mut kinds: Vec<MechanismKind> = models.iter().flat_map(|own| own.causes.clone()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    let alone = |kind: MechanismKind| {
        models.iter().filter(|own| own.causes == [kind]).map(|own| own.log_odds).fold(0.0, f64::max)
    };
    let error_sd = |own: &ComparedModel, gain: f64| libm::hypot(EVIDENCE_SD, own.gain_error * gain.max(0.0));
    let errors_of = |own: &ComparedModel| -> Vec<(usize, f64)> {
        let mut causes = own.causes.clone();
        causes.sort_by(|a, b| alone(*b).total_cmp(&alone(*a)));
        let mut explained = 0.0;
        let mut errors = Vec::new();
        for (place, kind) in causes.iter().enumerate() {
            // The first cause has what it gains alone, the last what is left.
            let gain = if place + 1 == causes.len() { own.log_odds - explained } else { alone(*kind) };
            explained += gain;
            errors.push((kinds.binary_search(kind).unwrap_or(0), error_sd(own, gain)));
        }
        errors
    };
    let errors: Vec<Vec<(usize, f64)>> = models.iter().map(errors_of).collect();
    let mut stream = Stream::new(0, "errors of the evidence");
    let mut mean = vec![0.0; models.len()];
    for _ in 0..EVIDENCE_DRAWS {
        let drawn: Vec<f64> = kinds.iter().map(|_| stream.normal()).collect();
        let log_odds: Vec<f64> = models
            .iter()
            .zip(&errors)
            .map(|(own, errors)| {
                own.log_odds + errors.iter().map(|(kind, sd)| sd * drawn[*kind]).sum::<f64>()
            })
            .collect();
        let (found, _) = probabilities(&log_odds);
        mean.iter_mut().zip(&found).for_each(|(mean, own)| *mean += own / EVIDENCE_DRAWS as f64);
    }
    mean
}

#[cfg(test)]
mod tests {
    use super::CauseProbabilities;
    use crate::wrist::mechanisms::MechanismKind;

    fn sure_of_a_friction() -> CauseProbabilities {
        CauseProbabilities {
            none: 0.001,
            none_of_these: 0.009,
            causes: vec![(MechanismKind::JointFriction, 0.99)],
            free_laws: Vec::new(),
        }
    }

    fn sum(own: &CauseProbabilities) -> f64 {
        own.none + own.none_of_these + own.causes[0].1
    }

    #[test]
    fn what_a_law_without_a_size_explains_is_in_no_catalogue() {
        let found = sure_of_a_friction();
        let (kind, probability) = found.causes[0];
        let without = found.clone().where_law_has_no_size(&[kind]);
        assert_eq!(without.of_cause(kind), 0.0);
        assert!(without.none_of_these >= probability && without.none == found.none);
        let others = found.clone().where_law_has_no_size(&[]);
        assert_eq!((others.of_cause(kind), others.none_of_these), (probability, found.none_of_these));
    }

    #[test]
    fn where_no_misfit_is_seen_no_cause_is_surer_than_the_test_allows() {
        let found = sure_of_a_friction().where_nothing_is_seen(0.6);
        assert!((found.none - 0.5).abs() < 1e-12 && (sum(&found) - 1.0).abs() < 1e-12, "{found:?}");
        assert!(sure_of_a_friction().where_nothing_is_seen(0.06).none < 0.5);
        let none = CauseProbabilities { none: 0.9, ..sure_of_a_friction() };
        assert!((none.where_nothing_is_seen(0.6).none - 0.9).abs() < 1e-12);
    }

    #[test]
    fn misfit_that_is_left_makes_a_law_in_no_catalogue_probable() {
        let found = sure_of_a_friction().where_misfit_is_left(0.003, 0.13);
        assert!((0.7..0.8).contains(&found.none_of_these) && (sum(&found) - 1.0).abs() < 1e-12, "{found:?}");
        let unknown = CauseProbabilities { none_of_these: 0.98, ..sure_of_a_friction() };
        assert!((unknown.where_misfit_is_left(0.003, 0.13).none_of_these - 0.98).abs() < 1e-12);
    }
}
