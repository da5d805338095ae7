//! Full refits of the shortlist, and which of them the data cannot tell apart.

use rayon::prelude::*;

use super::score_test::Probe;
use crate::fit::{ExtensionSearch, Fit, Model, Observations, ScreenedExtension};
use crate::wrist::mechanisms::MechanismKind;

/// A mechanism added to a fit, all parameters fitted anew.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Which.
    pub kind: MechanismKind,
    /// The fit with it.
    pub fit: Fit,
    /// What the sum of squares lost, in units of the noise.
    pub worth: f64,
}

impl Candidate {
    /// The worth less what as many free parameters gain from noise alone.
    pub fn merit(&self) -> f64 {
        self.worth - 2.0 * fitted_count(self.kind) as f64
    }

    /// The values of its parameters.
    pub fn values(&self) -> &[f64] {
        self.fit.added()
    }
}

fn fitted_count(kind: MechanismKind) -> usize {
    kind.parameters().iter().filter(|parameter| parameter.fitted).count()
}

/// The mechanisms that were fitted, the best first.
#[derive(Debug, Clone)]
pub struct Shortlist {
    /// They.
    pub candidates: Vec<Candidate>,
    /// Variance of the residuals over what the noise says, at the best of them; at least one.
    pub unit: f64,
}

impl Shortlist {
    /// The same with one of its kinds in front.
    pub fn led_by(mut self, kind: MechanismKind) -> Self {
        self.candidates.sort_by_key(|own| own.kind != kind);
        self
    }
}

/// A mechanism is fitted to all trials if what it promises on some comes this near to what the best does, in units of the noise, or
/// as a part of that.
const PROMISED: f64 = 80.0;
const PART_PROMISED: f64 = 0.35;

/// A mechanism that was fitted roughly is fitted with all care if it comes this near to the best, in units of the noise, or as
/// a part of what the best is worth: yields that a rough fit leaves in the wrong place cost as much.
const WITHIN_REACH: f64 = 40.0;
const PART_OF_BEST: f64 = 0.06;

/// It is not if it is worth less than this part of the best, however little that is.
const LEAST_PART: f64 = 0.25;

/// Every mechanism that was probed, fitted in full; the best with all care. The best first.
///
/// What screening promises tells where to start, not whom to leave out: a model that lacks something large has gone to where
/// the step to the right mechanism is not straight. So each starts from a guess of its own, and, since what is missing may
/// also be small, from where `fit` ended. What each is worth counts from the fit `before`.
pub fn candidates(
    prepared: &Observations,
    before: &Fit,
    fit: &Fit,
    probes: &[Probe],
    freedom: f64,
) -> Shortlist {
    let mut kinds: Vec<MechanismKind> = probes.iter().map(|probe| probe.kind).collect();
    kinds.dedup();
    let before = before.cost();
    let search = ExtensionSearch::new(prepared, fit);
    let candidate = |fit: Fit, kind| Candidate { kind, worth: 2.0 * (before - fit.cost()), fit };
    let mut glances: Vec<(MechanismKind, ScreenedExtension)> = kinds
        .into_par_iter()
        .map(|kind| {
            let of_kind = probes.iter().filter(|probe| probe.kind == kind);
            let models: Vec<Model> = of_kind.map(|probe| model_with(fit, probe)).collect();
            (kind, search.screen(&models))
        })
        .collect();
    let best = glances.iter().map(|(_, glance)| glance.predicted_gain).fold(0.0, f64::max);
    let within = PROMISED.max(PART_PROMISED * best);
    glances.retain(|(_, glance)| glance.predicted_gain > best - within);
    let mut rough: Vec<Candidate> =
        glances.into_par_iter().map(|(kind, glance)| candidate(search.complete(&glance), kind)).collect();
    rough.sort_by(|a, b| b.worth.total_cmp(&a.worth));
    let best = rough.first().map_or(0.0, |own| own.worth);
    let least = (best - WITHIN_REACH.max(PART_OF_BEST * best)).max(LEAST_PART * best);
    rough.retain(|own| own.worth >= least);
    let mut settled: Vec<Candidate> = rough
        .into_par_iter()
        .map(|own| candidate(search.restart(own.fit).refined(prepared), own.kind))
        .collect();
    let best = settled.iter().map(|own| 2.0 * own.fit.cost()).fold(f64::INFINITY, f64::min);
    let unit = (best / freedom).clamp(1.0, f64::MAX);
    settled.iter_mut().for_each(|own| own.worth /= unit);
    settled.sort_by(|a, b| b.merit().total_cmp(&a.merit()));
    for own in &settled {
        tracing::debug!(beside = ?fit.kinds, candidate = own.kind.id(), worth = own.worth, values = ?own.values());
    }
    Shortlist { candidates: settled, unit }
}

/// The model of `fit` with a probe's mechanism, which starts at the values probed: how far it will go, and to which side, is for
/// the fit to find, since a step to it is seldom straight.
fn model_with(fit: &Fit, probe: &Probe) -> Model {
    let mut model = fit.model.clone().with(probe.kind);
    if let Some(added) = model.mechanisms.last_mut() {
        for (treatment, value) in added.parameters.iter_mut().zip(&probe.values) {
            treatment.value = Some(*value);
        }
    }
    model
}
