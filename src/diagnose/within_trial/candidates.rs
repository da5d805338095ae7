//! Candidate mechanisms: the model extended by each mechanism and fitted in full.

use rayon::prelude::*;

use super::score_test::Probe;
use crate::fit::{ExtensionSearch, Fit, Model, Observations, ScreenedExtension};
use crate::wrist::mechanisms::MechanismKind;

/// A mechanism added to the model, with all parameters refitted.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// The mechanism.
    pub kind: MechanismKind,
    /// The fit with the mechanism.
    pub fit: Fit,
    /// Decrease of the whitened sum of squares, relative to the residual variance of the best candidate (chi-square units).
    pub chi_square_gain: f64,
}

impl Candidate {
    /// `chi_square_gain` less 2 per fitted parameter (as Akaike's criterion).
    pub fn penalised_gain(&self) -> f64 {
        self.chi_square_gain - 2.0 * fitted_count(self.kind) as f64
    }

    /// Values of the mechanism's parameters.
    pub fn values(&self) -> &[f64] {
        self.fit.last_mechanism_parameters()
    }
}

fn fitted_count(kind: MechanismKind) -> usize {
    kind.parameters().iter().filter(|parameter| parameter.fitted).count()
}

/// The candidates that were fitted.
#[derive(Debug, Clone)]
pub struct RankedCandidates {
    /// The candidates, the best first.
    pub candidates: Vec<Candidate>,
    /// Ratio of the residual variance to the noise variance for the best candidate; at least 1.
    pub unit: f64,
}

impl RankedCandidates {
    /// The candidates with one mechanism moved to the front.
    pub fn with_first(mut self, kind: MechanismKind) -> Self {
        self.candidates.sort_by_key(|own| own.kind != kind);
        self
    }
}

/// A mechanism is fitted to all trials if the decrease of chi-square predicted from some of the trials is within this distance of the
/// best mechanism's.
const PROMISING_DISTANCE: f64 = 80.0;
/// Alternative to `PROMISING_DISTANCE`, as a fraction of the best mechanism's predicted decrease; the larger distance applies.
const PROMISING_FRACTION: f64 = 0.35;

/// A roughly fitted mechanism is refined if its decrease of chi-square is within this distance of the best: elastic limits at a wrong
/// local optimum cost as much.
const REFINED_DISTANCE: f64 = 40.0;
/// Alternative to `REFINED_DISTANCE`, as a fraction of the best mechanism's decrease; the larger distance applies.
const REFINED_FRACTION: f64 = 0.06;

/// Smallest decrease of chi-square, as a fraction of the best mechanism's, with which a mechanism is refined.
const MIN_REFINED_FRACTION: f64 = 0.25;

/// Fits the model of `fit` extended by each probed mechanism, and refines the best. `chi_square_gain` is relative to the fit `before`.
///
/// The score test chooses starting values and excludes no mechanism: the optimum of a model that lacks a large effect can be far from
/// that of the right model, where a linear approximation fails. Each extension starts from its own starting values and, for small
/// effects, from the optimum of `fit`.
pub fn candidates(
    observations: &Observations,
    before: &Fit,
    fit: &Fit,
    probes: &[Probe],
    freedom: f64,
) -> RankedCandidates {
    let mut kinds: Vec<MechanismKind> = probes.iter().map(|probe| probe.kind).collect();
    kinds.dedup();
    let before = before.cost();
    let search = ExtensionSearch::new(observations, fit);
    let candidate = |fit: Fit, kind| Candidate { kind, chi_square_gain: 2.0 * (before - fit.cost()), fit };
    let mut glances: Vec<(MechanismKind, ScreenedExtension)> = kinds
        .into_par_iter()
        .map(|kind| {
            let of_kind = probes.iter().filter(|probe| probe.kind == kind);
            let models: Vec<Model> = of_kind.map(|probe| model_with(fit, probe)).collect();
            (kind, search.screen(&models))
        })
        .collect();
    let best = glances.iter().map(|(_, glance)| glance.predicted_gain).fold(0.0, f64::max);
    let within = PROMISING_DISTANCE.max(PROMISING_FRACTION * best);
    glances.retain(|(_, glance)| glance.predicted_gain > best - within);
    let mut rough: Vec<Candidate> =
        glances.into_par_iter().map(|(kind, glance)| candidate(search.complete(&glance), kind)).collect();
    rough.sort_by(|a, b| b.chi_square_gain.total_cmp(&a.chi_square_gain));
    let best = rough.first().map_or(0.0, |own| own.chi_square_gain);
    let least = (best - REFINED_DISTANCE.max(REFINED_FRACTION * best)).max(MIN_REFINED_FRACTION * best);
    rough.retain(|own| own.chi_square_gain >= least);
    let mut settled: Vec<Candidate> = rough
        .into_par_iter()
        .map(|own| candidate(search.restart(own.fit).refined(observations), own.kind))
        .collect();
    let best = settled.iter().map(|own| 2.0 * own.fit.cost()).fold(f64::INFINITY, f64::min);
    let unit = (best / freedom).clamp(1.0, f64::MAX);
    settled.iter_mut().for_each(|own| own.chi_square_gain /= unit);
    settled.sort_by(|a, b| b.penalised_gain().total_cmp(&a.penalised_gain()));
    for own in &settled {
        tracing::debug!(beside = ?fit.kinds, candidate = own.kind.id(), chi_square_gain = own.chi_square_gain, values = ?own.values());
    }
    RankedCandidates { candidates: settled, unit }
}

/// The model of `fit` extended by a probe's mechanism, which starts at the values of the probe.
fn model_with(fit: &Fit, probe: &Probe) -> Model {
    let mut model = fit.model.clone().with(probe.kind);
    if let Some(added) = model.mechanisms.last_mut() {
        for (treatment, value) in added.parameters.iter_mut().zip(&probe.values) {
            treatment.value = Some(*value);
        }
    }
    model
}
