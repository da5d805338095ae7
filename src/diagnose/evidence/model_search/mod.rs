//! The models that are compared: none, each mechanism, pairs of mechanisms, and free laws.
//!
//! | file | story |
//! |---|---|
//! | `linear_estimate` | what a further mechanism would add to a model, to first order |
//! | `single_causes` | models of one cause, and of a free law each |
//! | `pairs` | models of two causes |
//! | `trial_outliers` | trials that do not belong |

mod linear_estimate;
mod pairs;
mod single_causes;
mod trial_outliers;

use rayon::prelude::*;

use super::model_posterior::{LeastEvidence, ModelPosterior};
use super::model_prior::ModelPrior;
use super::rig_knowledge::CHANGED_AFTER_RIG_TRIALS;
use super::session_prior::SessionPrior;
use crate::fit::{DECREMENT_RATIO, Fit, K_DEC, K_SRS, Model, Observations, ParameterSpec, Transform, X_E};
use crate::wrist::mechanisms::MechanismKind;

/// Elastic limits from which all trials start once more, as parts of the largest motor angle in the window; k_dec has its prior median there.
const LIMIT_RESTARTS: [f64; 2] = [0.4, 0.6];

/// A model whose probability, relative to the best, is estimated to be below e to the minus this is not computed exactly: together they
/// have less than a thousandth.
const NEGLIGIBLE_LOG_ODDS: f64 = 14.0;

/// Part of the best model's gain below which a model is not within reach, whatever its laws: a law that is off by a fifth leaves a
/// twenty-fifth of what it explains.
const DEVIATION_REACH: f64 = 0.5;

/// Standard deviation of the error of what a cause gains, as a part of it: the motion is sampled and smoothed, and a filter is not quite as
/// stated, so that what a mechanism does is computed to a hundredth of it.
const GAIN_ERROR: f64 = 0.01;

/// The same where the motions are known between the steps of a coarse encoder: of delays and low-passes in development sessions the true one
/// gains up to a twentieth less than the other (decision 49).
const GAIN_ERROR_IN_STEPS: f64 = 0.05;

/// A model with its posterior.
#[derive(Debug, Clone)]
pub struct ComparedModel {
    /// The causes.
    pub causes: Vec<MechanismKind>,
    /// Logarithm of evidence and prior odds, against no cause.
    pub log_odds: f64,
    /// Standard deviation of the error of what a cause gains, as a part of it.
    pub gain_error: f64,
    /// The posterior.
    pub posterior: ModelPosterior,
    /// The trials that do not belong, if that is a cause.
    pub outliers: Vec<usize>,
}

impl ComparedModel {
    /// Whether the session's trials are fitted with the mechanism `kind`. A cause that rig trials tell is not: their value is in the
    /// constants of all fits.
    pub fn fits(&self, kind: MechanismKind) -> bool {
        self.posterior.added.contains(&kind)
    }
}

/// All models that were compared.
pub struct ModelSearch<'a> {
    observations: &'a Observations,
    /// The priors.
    pub prior: SessionPrior,
    /// What each cause is held to be before the data.
    pub model_prior: ModelPrior,
    before: &'a Fit,
    /// The models, none of the causes first.
    pub models: Vec<ComparedModel>,
    none_evidence: f64,
    gain_error: f64,
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
        let none = best(starts.par_iter().map(|start| {
            ModelPosterior::with_exact_laws(observations, &prior, start, &[], None, LeastEvidence::NONE)
        }))?;
        let none_evidence = none.log_evidence;
        tracing::debug!(none_evidence, noise = none.spreads.noise, "no cause");
        let mut all = applicable.to_vec();
        all.extend(prior.ranges.kinds());
        let in_steps = observations.trials.iter().any(|trial| trial.motion_errors.is_some());
        let gain_error = if in_steps { GAIN_ERROR_IN_STEPS } else { GAIN_ERROR };
        let models = vec![ComparedModel {
            causes: Vec::new(),
            log_odds: 0.0,
            gain_error,
            posterior: none,
            outliers: Vec::new(),
        }];
        let model_prior = ModelPrior::new(&all);
        Some(Self { observations, prior, model_prior, before, models, none_evidence, gain_error })
    }

    fn add(&mut self, causes: Vec<MechanismKind>, posterior: ModelPosterior, outliers: Vec<usize>) {
        let log_odds = posterior.log_evidence - self.none_evidence + self.prior_log_odds(&causes);
        tracing::debug!(
            ?causes,
            log_odds,
            noise = posterior.spreads.noise,
            ?outliers,
            steps = posterior.steps,
            decrease = posterior.quadratic.decrease
        );
        let gain_error = self.gain_error;
        self.models.push(ComparedModel { causes, log_odds, gain_error, posterior, outliers });
    }

    /// Logarithm of the odds, before the session, of a model whose `causes` its trials are fitted with, each by one of its laws.
    fn prior_log_odds(&self, causes: &[MechanismKind]) -> f64 {
        let by_law: f64 = causes.iter().map(|cause| -libm::log(cause.laws().len().max(1) as f64)).sum();
        let by_rig_trials: f64 = causes.iter().map(|cause| self.prior.rig.log_odds_in_session(*cause)).sum();
        self.model_prior.log_odds(causes) + by_law + by_rig_trials
    }

    /// Adds the models in which a constant was off during the rig trials, beside at most one other cause.
    ///
    /// All models are fitted with the constants as measured, so that such a cause changes no fit: the rig trials alone decide. It does not
    /// help to explain what came with the person.
    pub fn add_told_causes(&mut self) {
        let told: Vec<MechanismKind> = self.prior.rig.told().collect();
        let mut added = Vec::new();
        for model in self.models.iter().filter(|model| model.causes.len() <= 1) {
            for kind in &told {
                added.push((model, vec![*kind]));
            }
        }
        for (place, one) in told.iter().enumerate() {
            added.extend(told[place + 1..].iter().map(|other| (&self.models[0], vec![*one, *other])));
        }
        let extended = |(model, kinds): (&ComparedModel, Vec<MechanismKind>)| {
            // A cause that was at work during the rig trials, and that the session is fitted with as well, has changed between them.
            let changed = kinds.iter().any(|kind| model.causes.contains(kind));
            let prior =
                if changed { libm::log(CHANGED_AFTER_RIG_TRIALS) } else { self.model_prior.log_odds(&kinds) };
            let kept = model.causes.iter().copied().filter(|kind| !kinds.contains(kind));
            ComparedModel {
                log_odds: model.log_odds + self.prior.rig.log_odds(&kinds) + prior,
                causes: kept.chain(kinds.iter().copied()).collect(),
                gain_error: model.gain_error,
                posterior: model.posterior.clone(),
                outliers: model.outliers.clone(),
            }
        };
        let extended: Vec<ComparedModel> = added.into_iter().map(extended).collect();
        for own in &extended {
            tracing::debug!(causes = ?own.causes, log_odds = own.log_odds, "told by rig trials");
        }
        self.models.extend(extended);
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

    /// Adds posteriors with exact laws, after the laws of those within reach of the best may deviate. One that explains nothing has no law
    /// that could.
    fn add_with_deviations(&mut self, plain: Vec<ModelPosterior>) {
        let gain = |own: &ModelPosterior| own.log_evidence - self.none_evidence;
        let best = plain.iter().map(gain).fold(self.best_log_odds(), f64::max);
        let is_near =
            |own: &ModelPosterior| gain(own) > (DEVIATION_REACH * best - NEGLIGIBLE_LOG_ODDS).max(0.0);
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

    /// `base` with the mechanism `kind` at `values` in addition.
    fn start_with(&self, base: &Fit, kind: MechanismKind, values: &[f64]) -> Fit {
        let model = starting_at(base.model.clone().with(kind), values);
        base.with_model(self.observations, &model)
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
            set(K_DEC, DECREMENT_RATIO.0 * fit.parameters[trial][K_SRS]);
        }
        starts.push(fit.at_solution(solution));
    }
    starts
}

fn best(posteriors: impl ParallelIterator<Item = Option<ModelPosterior>>) -> Option<ModelPosterior> {
    let all: Vec<ModelPosterior> = posteriors.flatten().collect();
    all.into_iter().max_by(|a, b| a.log_evidence.total_cmp(&b.log_evidence))
}
