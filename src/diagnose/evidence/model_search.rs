//! The models that are compared: none, each mechanism, pairs of mechanisms, and free laws.

use nalgebra::DVector;
use rayon::prelude::*;

use super::model_posterior::ModelPosterior;
use super::model_prior::ModelPrior;
use super::session_equations::Products;
use super::session_prior::{SessionPrior, value_without_effect};
use crate::diagnose::predicted_torque::torques;
use crate::fit::{ExtensionSearch, Fit, K_DEC, K_SRS, Model, Observations, ParameterSpec, Transform, X_E};
use crate::wrist::mechanisms::{EvidenceSource, MechanismKind, Prior};

/// Elastic limits from which all trials start once more, as parts of the largest motor angle in the window; k_dec is 0.6 of k_srs there.
const LIMIT_RESTARTS: [f64; 2] = [0.4, 0.6];

/// A model whose probability, relative to the best, is estimated to be below e to the minus this is not computed exactly: together they
/// have less than a thousandth.
const NEGLIGIBLE_LOG_ODDS: f64 = 14.0;

/// Standard errors by which an estimate from a part of the trials may be wrong before a model is given up.
const SCREENING_ERRORS: f64 = 4.0;

/// Part of the session's trials on which extensions are screened.
const SCREENED_PART: f64 = 1.0 / 3.0;

/// An estimate of the second of two causes, linear about the first, may be wrong by this part of what the second is worth.
const LINEAR_ERROR: f64 = 0.25;

/// Smallest size at which a one-sided mechanism starts, and largest multiple of a logarithm, in units of the probe.
const LEAST_SIZE: f64 = 0.5;
const LARGEST_MULTIPLE: f64 = 4.0;

/// Part of the best model's gain below which a model is not within reach, whatever its laws: a law that is off by a fifth leaves a
/// twenty-fifth of what it explains.
const DEVIATION_REACH: f64 = 0.5;

/// Largest number of pairs that are fitted first, and the number of starts of each. Afterwards all others are fitted beside the causes of
/// the best.
const MAX_PAIRS: usize = 8;
const STARTS_OF_A_PAIR: usize = 2;

/// Standard deviation of a trial that does not belong, by that of the others.
const OUTLIER_SDS: f64 = 10.0;

/// Number of trials, at most, that do not belong: one in four.
const TRIALS_PER_OUTLIER: usize = 4;

/// A model with its posterior.
#[derive(Debug, Clone)]
pub struct ComparedModel {
    /// The causes.
    pub causes: Vec<MechanismKind>,
    /// Logarithm of evidence and prior odds, against no cause.
    pub log_odds: f64,
    /// The posterior.
    pub posterior: ModelPosterior,
    /// The trials that do not belong, if that is a cause.
    pub outliers: Vec<usize>,
}

/// All models that were compared.
pub struct ModelSearch<'a> {
    observations: &'a Observations,
    /// The priors.
    pub prior: SessionPrior,
    model_prior: ModelPrior,
    before: &'a Fit,
    /// The models, none of the causes first.
    pub models: Vec<ComparedModel>,
    none_evidence: f64,
}

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

/// A mechanism at probe values, with the change that it makes.
struct ProbedChange {
    kind: MechanismKind,
    values: Vec<f64>,
    change: Vec<DVector<f64>>,
}

impl<'a> ModelSearch<'a> {
    /// The search about `before`, the fit of the model as given. `None` if even that has no posterior.
    pub fn new(
        observations: &'a Observations,
        before: &'a Fit,
        prior: SessionPrior,
        applicable: &[MechanismKind],
    ) -> Option<Self> {
        let starts = limit_restarts(observations, before);
        let none = best(
            starts
                .par_iter()
                .map(|start| ModelPosterior::with_exact_laws(observations, &prior, start, &[], None)),
        )?;
        let none_evidence = none.log_evidence;
        tracing::debug!(none_evidence, noise = none.spreads.noise, "no cause");
        let mut all = applicable.to_vec();
        all.extend(prior.ranges.kinds());
        let models =
            vec![ComparedModel { causes: Vec::new(), log_odds: 0.0, posterior: none, outliers: Vec::new() }];
        Some(Self { observations, prior, model_prior: ModelPrior::new(&all), before, models, none_evidence })
    }

    fn add(&mut self, causes: Vec<MechanismKind>, posterior: ModelPosterior, outliers: Vec<usize>) {
        let log_odds = posterior.log_evidence - self.none_evidence + self.model_prior.log_odds(&causes);
        tracing::debug!(
            ?causes,
            log_odds,
            noise = posterior.spreads.noise,
            ?outliers,
            steps = posterior.steps,
            decrease = posterior.quadratic.decrease
        );
        self.models.push(ComparedModel { causes, log_odds, posterior, outliers });
    }

    /// The largest log odds so far.
    pub fn best_log_odds(&self) -> f64 {
        self.models.iter().map(|own| own.log_odds).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Index of the most probable model with `count` causes of the catalogue; 0 if there is none.
    pub fn best_with(&self, count: usize) -> usize {
        let wanted = |index: &usize| {
            let causes = &self.models[*index].causes;
            causes.len() == count && causes.iter().all(|kind| !kind.is_free_law())
        };
        let candidates = (0..self.models.len()).filter(wanted);
        candidates.max_by(|a, b| self.models[*a].log_odds.total_cmp(&self.models[*b].log_odds)).unwrap_or(0)
    }

    /// The session.
    pub fn observations(&self) -> &'a Observations {
        self.observations
    }

    /// Adds the models of one cause each.
    pub fn add_single_causes(&mut self, kinds: &[MechanismKind]) {
        let (observations, prior, none) = (self.observations, &self.prior, &self.models[0].posterior);
        let search = ExtensionSearch::new(observations, self.before);
        let (within, across): (Vec<MechanismKind>, Vec<MechanismKind>) = kinds
            .iter()
            .copied()
            .filter(|kind| kind.evidence() != EvidenceSource::SingleTrials)
            .partition(|kind| kind.evidence() == EvidenceSource::Trace);
        let screened: Vec<_> = within
            .par_iter()
            .map(|kind| {
                let models: Vec<Model> = kind
                    .probes(&prior.context)
                    .into_iter()
                    .map(|values| starting_at(self.before.model.clone().with(*kind), &values))
                    .collect();
                (*kind, search.screen(&models))
            })
            .collect();
        let promised = screened.iter().map(|(_, own)| own.predicted_gain).fold(0.0, f64::max);
        let within_reach = |gain: f64| {
            let error = libm::sqrt(4.0 * promised * (1.0 / SCREENED_PART - 1.0));
            gain > promised - 2.0 * NEGLIGIBLE_LOG_ODDS - SCREENING_ERRORS * error
        };
        let from_screening: Vec<(MechanismKind, ModelPosterior)> = screened
            .into_par_iter()
            .filter(|(_, own)| within_reach(own.predicted_gain))
            .filter_map(|(kind, own)| {
                let fit = search.complete(&own);
                Some((
                    kind,
                    ModelPosterior::with_exact_laws(observations, prior, &fit, &[kind], Some(&none.spreads))?,
                ))
            })
            .collect();
        let directions = self.directions(none, kinds);
        let Some(about_none) = LinearModel::new(none) else { return };
        let from_none: Vec<(MechanismKind, ModelPosterior)> = directions
            .par_iter()
            .filter_map(|own| {
                let (_, values) = self.linear_gain(&about_none, own)?;
                let start = self.start_with(none, own.kind, &values);
                let causes = [own.kind];
                Some((
                    own.kind,
                    ModelPosterior::with_exact_laws(
                        observations,
                        prior,
                        &start,
                        &causes,
                        Some(&none.spreads),
                    )?,
                ))
            })
            .collect();
        let best_of = |kind: MechanismKind| {
            let found = from_screening.iter().chain(&from_none).filter(|(own, _)| *own == kind);
            found.max_by(|a, b| a.1.log_evidence.total_cmp(&b.1.log_evidence)).map(|(_, own)| own.clone())
        };
        let plain: Vec<ModelPosterior> = within.into_iter().chain(across).filter_map(best_of).collect();
        self.add_with_deviations(plain);
    }

    /// Adds posteriors with exact laws, after the laws of those within reach of the best may deviate.
    fn add_with_deviations(&mut self, plain: Vec<ModelPosterior>) {
        let gain = |own: &ModelPosterior| own.log_evidence - self.none_evidence;
        let best = plain.iter().map(gain).fold(self.best_log_odds(), f64::max);
        let is_near = |own: &ModelPosterior| gain(own) > DEVIATION_REACH * best - NEGLIGIBLE_LOG_ODDS;
        let (observations, prior) = (self.observations, &self.prior);
        let all: Vec<ModelPosterior> = plain
            .into_par_iter()
            .map(|own| {
                let deviating = is_near(&own).then(|| own.with_deviating_laws(observations, prior)).flatten();
                deviating.unwrap_or(own)
            })
            .collect();
        for posterior in all {
            self.add(posterior.added.clone(), posterior, Vec::new());
        }
    }

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
                    let prior = self.model_prior.log_odds(&[direction.kind]);
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
        // What is best beside either cause of the best pair may have been estimated badly beside the other.
        let best = self.models[self.best_with(2)].causes.clone();
        let mut chosen: Vec<&PairEstimate> = Vec::new();
        for cause in best.iter().filter(|_| leaves_misfit && best.len() == 2) {
            for own in estimates.iter().filter(|own| own.causes[0] == *cause) {
                let is_known = self.models.iter().any(|model| own.is_of(&model.causes))
                    || chosen.iter().any(|other| other.is_same_pair(own));
                if !is_known {
                    chosen.push(own);
                }
            }
        }
        self.fit_pairs(&chosen);
    }

    /// Fits pairs from their estimated values; of several starts of a pair the best counts.
    fn fit_pairs(&mut self, chosen: &[&PairEstimate]) {
        let (observations, prior) = (self.observations, &self.prior);
        let none = &self.models[0].posterior;
        let found: Vec<ModelPosterior> = chosen
            .par_iter()
            .filter_map(|own| {
                let first = self.models.iter().find(|model| model.causes == [own.causes[0]])?;
                let start = self.start_with(&first.posterior, own.causes[1], &own.values);
                ModelPosterior::with_exact_laws(observations, prior, &start, &own.causes, Some(&none.spreads))
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

    /// Adds the models of a free law each.
    pub fn add_free_laws(&mut self) {
        let (observations, prior, none) = (self.observations, &self.prior, &self.models[0].posterior);
        let kinds: Vec<MechanismKind> =
            prior.ranges.kinds().filter(|kind| !self.before.kinds.contains(kind)).collect();
        let found: Vec<(MechanismKind, ModelPosterior)> = kinds
            .into_par_iter()
            .filter_map(|kind| {
                let base = self.without_deviations(none);
                let model = prior.ranges.with_free_law(base.model.clone(), kind);
                let start = base.with_model(observations, &model);
                Some((
                    kind,
                    ModelPosterior::with_exact_laws(
                        observations,
                        prior,
                        &start,
                        &[kind],
                        Some(&none.spreads),
                    )?,
                ))
            })
            .collect();
        for (kind, posterior) in found {
            self.add(vec![kind], posterior, Vec::new());
        }
    }

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
            let products = Products::new(&own.posterior.linear);
            let estimates: Vec<(usize, f64)> = (0..count)
                .into_par_iter()
                .filter(|trial| !outliers.contains(trial))
                .filter_map(|trial| {
                    let mut design = own.posterior.design.clone();
                    design.variance_factor = factors(&outliers, trial);
                    let mut spreads = spreads.clone();
                    let mut quadratic = design.quadratic(&spreads, &own.posterior.point, &products)?;
                    for _ in 0..8 {
                        spreads = quadratic.expected.spreads(design.law.as_ref(), &spreads).0;
                        quadratic = design.quadratic(&spreads, &own.posterior.point, &products)?;
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

    /// The fit of a posterior without the free laws by which its mechanisms' laws deviate.
    pub fn without_deviations(&self, posterior: &ModelPosterior) -> Fit {
        let is_deviation = |kind: &MechanismKind| {
            kind.is_free_law() && !posterior.added.contains(kind) && !self.before.kinds.contains(kind)
        };
        let mut fit = posterior.fit.clone();
        for kind in posterior.fit.kinds.iter().filter(|kind| is_deviation(kind)) {
            fit = fit.with_mechanism_removed(self.observations, *kind);
        }
        fit
    }

    /// What each of `kinds` would change at the optimum of `posterior`, for each of its probe values.
    fn directions(&self, posterior: &ModelPosterior, kinds: &[MechanismKind]) -> Vec<ProbedChange> {
        let (observations, fit) = (self.observations, &posterior.fit);
        let base = torques(observations, &fit.kinds, &fit.parameters);
        let new = |kind: &&MechanismKind| !fit.kinds.contains(kind) && !kind.parameters().is_empty();
        let mut directions = Vec::new();
        for kind in kinds.iter().filter(new) {
            for values in kind.probes(&self.prior.context) {
                let mut all = fit.kinds.clone();
                all.push(*kind);
                let with = |own: &Vec<f64>| own.iter().chain(&values).copied().collect();
                let parameters: Vec<Vec<f64>> = fit.parameters.iter().map(with).collect();
                let changed = torques(observations, &all, &parameters);
                let change = (0..base.len())
                    .map(|trial| {
                        let by: Vec<f64> =
                            changed[trial].iter().zip(&base[trial]).map(|(to, from)| to - from).collect();
                        fit.objective.whiten(observations.noise_index[trial], &by)
                    })
                    .collect();
                directions.push(ProbedChange { kind: *kind, values, change });
            }
        }
        directions
    }

    /// What a mechanism adds to the log evidence of `about` if its effect is linear in its size, and its values at the size found.
    fn linear_gain(&self, about: &LinearModel, direction: &ProbedChange) -> Option<(f64, Vec<f64>)> {
        let kind = direction.kind;
        let parameter = kind.parameters().first()?;
        let absent = value_without_effect(kind, &self.prior.context);
        if !direction.change.iter().all(|own| own.iter().all(|value| value.is_finite())) {
            return None;
        }
        let prior = kind.prior(0, &self.prior.context);
        let logarithmic = parameter.low > 0.0;
        // In units of the probe.
        let sd = match (prior, absent) {
            (Prior::Normal { sd, .. } | Prior::HalfNormal { sd }, Some(absent)) => {
                sd / (direction.values[0] - absent).abs().max(1e-12)
            }
            (Prior::LogNormal { log_sd, .. }, Some(absent)) => {
                log_sd / libm::log(direction.values[0] / absent).abs().max(1e-6)
            }
            _ => 1.0,
        };
        let posterior = about.posterior;
        let products = about.products.with_column(&posterior.linear, &direction.change);
        let mut point = posterior.point.clone();
        point.common = point.common.push(0.0);
        let quadratic = posterior.design.with_column(sd).quadratic(&posterior.spreads, &point, &products)?;
        let gain = quadratic.log_evidence - about.log_evidence;
        let multiple = quadratic.step.common[point.common.len() - 1];
        let mut values = direction.values.clone();
        values[0] = match absent {
            // Close to no effect, but where other parameters still act.
            Some(absent) if matches!(prior, Prior::HalfNormal { .. }) => {
                absent + multiple.max(LEAST_SIZE) * (values[0] - absent)
            }
            Some(absent) if logarithmic => {
                absent * libm::pow(values[0] / absent, multiple.clamp(-LARGEST_MULTIPLE, LARGEST_MULTIPLE))
            }
            Some(absent) => absent + multiple * (values[0] - absent),
            // Of a mechanism without a value of no effect, such as a low-pass, the probe itself.
            None => values[0],
        };
        values[0] = values[0].clamp(parameter.low, parameter.high);
        Some((gain, values))
    }

    /// The fit of `posterior` with the mechanism `kind` at `values` in addition.
    fn start_with(&self, posterior: &ModelPosterior, kind: MechanismKind, values: &[f64]) -> Fit {
        let base = self.without_deviations(posterior);
        let model = starting_at(base.model.clone().with(kind), values);
        base.with_model(self.observations, &model)
    }
}

/// A posterior with what is computed once for many directions.
struct LinearModel<'a> {
    posterior: &'a ModelPosterior,
    products: Products,
    log_evidence: f64,
}

impl<'a> LinearModel<'a> {
    fn new(posterior: &'a ModelPosterior) -> Option<Self> {
        let products = Products::new(&posterior.linear);
        let design = &posterior.design;
        let log_evidence = design.quadratic(&posterior.spreads, &posterior.point, &products)?.log_evidence;
        Some(Self { posterior, products, log_evidence })
    }
}

/// `model`, whose last mechanism starts at `values`.
fn starting_at(mut model: Model, values: &[f64]) -> Model {
    if let Some(added) = model.mechanisms.last_mut() {
        for (spec, value) in added.parameters.iter_mut().zip(values) {
            *spec = ParameterSpec { value: Some(*value), ..spec.clone() };
        }
    }
    model
}

/// `fit`, and the same with the elastic limits of all trials elsewhere.
fn limit_restarts(observations: &Observations, fit: &Fit) -> Vec<Fit> {
    let mut starts = vec![fit.clone()];
    for part in LIMIT_RESTARTS {
        let mut solution = fit.solution.clone();
        for (trial, transforms) in fit.parameterisation.transforms.iter().enumerate() {
            let mut set = |parameter: usize, value: f64| {
                if let Transform::Logarithmic { coordinate, factor } = transforms[parameter] {
                    solution.coordinates[coordinate] = libm::log(value / factor);
                }
            };
            set(X_E, part * observations.peak_angle_rad(trial));
            set(K_DEC, 0.6 * fit.parameters[trial][K_SRS]);
        }
        starts.push(fit.at_solution(solution));
    }
    starts
}

fn best(posteriors: impl ParallelIterator<Item = Option<ModelPosterior>>) -> Option<ModelPosterior> {
    let all: Vec<ModelPosterior> = posteriors.flatten().collect();
    all.into_iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
}
