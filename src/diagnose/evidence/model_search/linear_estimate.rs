//! What a further mechanism would add to the evidence of a model, if its effect is linear in its size.

use nalgebra::DVector;

use super::{ComparedModel, ModelSearch};
use crate::diagnose::evidence::model_posterior::ModelPosterior;
use crate::diagnose::evidence::session_equations::Quadratic;
use crate::diagnose::evidence::session_prior::value_without_effect;
use crate::diagnose::predicted_torque::{torques, whitened_change};
use crate::wrist::mechanisms::{MechanismKind, Prior};

/// Smallest size at which a one-sided mechanism starts, and largest multiple of a logarithm, in units of the probe.
const LEAST_SIZE: f64 = 0.5;

const LARGEST_MULTIPLE: f64 = 4.0;

/// A mechanism at probe values, with the change that it makes.
pub(super) struct ProbedChange {
    pub(super) kind: MechanismKind,
    values: Vec<f64>,
    change: Vec<DVector<f64>>,
}

/// A posterior with its quadratic, from which what a further mechanism adds follows to first order.
pub(super) struct LinearModel<'a> {
    posterior: &'a ModelPosterior,
    quadratic: Quadratic,
}

impl<'a> LinearModel<'a> {
    pub(super) fn new(posterior: &'a ModelPosterior) -> Option<Self> {
        let quadratic =
            posterior.design.quadratic(&posterior.spreads, &posterior.point, &posterior.products)?;
        Some(Self { posterior, quadratic })
    }
}

impl ModelSearch<'_> {
    /// What each of `kinds` would change at the optimum of `posterior`, for each of its probe values.
    pub(super) fn directions(
        &self,
        posterior: &ModelPosterior,
        kinds: &[MechanismKind],
    ) -> Vec<ProbedChange> {
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
                let change = whitened_change(observations, fit, &base, &changed);
                directions.push(ProbedChange { kind: *kind, values, change });
            }
        }
        directions
    }

    /// What the cause `kind` of `model` does to the whitened predictions, where its law is the catalogued one.
    pub fn effect_of(&self, model: &ComparedModel, kind: MechanismKind) -> Option<Vec<DVector<f64>>> {
        let fit = self.without_deviations(&model.posterior);
        let without = fit.with_mechanism_removed(self.observations, kind);
        let with = torques(self.observations, &fit.kinds, &fit.parameters);
        let without = torques(self.observations, &without.kinds, &without.parameters);
        let changes = whitened_change(self.observations, &fit, &without, &with);
        changes.iter().all(|own| own.iter().all(|value| value.is_finite())).then_some(changes)
    }

    /// What a mechanism adds to the log evidence of `about` if its effect is linear in its size, and its values at the size found.
    pub(super) fn linear_gain(
        &self,
        about: &LinearModel,
        direction: &ProbedChange,
    ) -> Option<(f64, Vec<f64>)> {
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
        let LinearModel { posterior, quadratic } = about;
        let noise = posterior.spreads.noise;
        let added = quadratic.with_column(&posterior.design, &posterior.linear, noise, &direction.change, sd);
        if !(added.log_evidence.is_finite() && added.value.is_finite()) {
            return None;
        }
        let multiple = added.value;
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
        Some((added.log_evidence, values))
    }
}
