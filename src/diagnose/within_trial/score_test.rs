//! Score test: how much of the residuals each mechanism would explain beyond what the free parameters absorb.

use nalgebra::DVector;

use super::residual_projection::{ResidualProjection, WhitenedTrials};
use crate::diagnose::applicability::missing;
use crate::diagnose::predicted_torque::{torques, whitened_change};
use crate::fit::{Fit, Observations};
use crate::wrist::mechanisms::{CATALOGUE, EvidenceSource, MechanismClass, MechanismKind, ProbeContext};

/// A mechanism with typical parameter values and its effect on the predictions.
#[derive(Debug, Clone)]
pub struct Probe {
    /// Whitened change of the predictions, less the part that the free parameters absorb.
    pub direction: WhitenedTrials,
    /// Norm of the whitened change before and after the absorption, in standard deviations of the noise.
    pub size: (f64, f64),
}

/// A mechanism that this session cannot show.
#[derive(Debug, Clone, PartialEq)]
pub struct UndetectableMechanism {
    /// The mechanism.
    pub kind: MechanismKind,
    /// The reason.
    pub reason: String,
}

/// Smallest norm of a typical effect after the absorption, in standard deviations of the noise, at which it counts as detectable.
const DETECTABLE_NORM: f64 = 0.5;

/// What priors and probe values may depend on.
pub fn probe_context(observations: &Observations) -> ProbeContext {
    let highest = observations.trials.iter().map(|trial| {
        let change = observations.torque_of(&trial.measured_nm).iter().copied().fold(0.0, f64::max);
        change + trial.direction * trial.torque_0_nm
    });
    ProbeContext {
        lever: observations.lever,
        highest_torque_nm: highest.fold(0.0, f64::max),
        window_s: observations.samples as f64 * observations.period_s,
    }
}

/// The probes of all mechanisms of the catalogue that act within the trials, and the mechanisms that cannot be detected there.
pub fn probes(
    observations: &Observations,
    fit: &Fit,
    tangent: &ResidualProjection,
) -> (Vec<Probe>, Vec<UndetectableMechanism>) {
    let session = probe_context(observations);
    let base = torques(observations, &fit.kinds, &fit.parameters);
    let (mut found, mut undetectable) = (Vec::new(), Vec::new());
    for kind in CATALOGUE.iter().copied().filter(|kind| !fit.kinds.contains(kind)) {
        if let Some(reason) = missing(observations, kind) {
            undetectable.push(UndetectableMechanism { kind, reason });
            continue;
        }
        if !matches!(kind.evidence(), EvidenceSource::Trace | EvidenceSource::AcrossTrials) {
            continue;
        }
        let mut largest = (0.0, 0.0);
        for values in kind.probes(&session) {
            let probe = probe(observations, fit, tangent, &base, kind, values);
            if probe.size.1 > largest.1 || largest.1 == 0.0 {
                largest = probe.size;
            }
            // What remains of a direction that is almost wholly absorbed is rounding error.
            if probe.size.1.is_finite()
                && probe.size.1 > 1e-3 * probe.size.0
                && probe.size.1 > DETECTABLE_NORM * 0.1
            {
                found.push(probe);
            }
        }
        if largest.1 < DETECTABLE_NORM && kind.class() != MechanismClass::Trial {
            undetectable.push(UndetectableMechanism {
                kind,
                reason: format!(
                    "a typical effect is {:.1} standard deviations of the noise in this session, and {:.2} after the free \
                     parameters have absorbed their part",
                    largest.0, largest.1
                ),
            });
        }
    }
    (found, undetectable)
}

fn probe(
    observations: &Observations,
    fit: &Fit,
    tangent: &ResidualProjection,
    base: &[Vec<f64>],
    kind: MechanismKind,
    values: Vec<f64>,
) -> Probe {
    let mut kinds = fit.kinds.clone();
    kinds.push(kind);
    let parameters: Vec<Vec<f64>> =
        fit.parameters.iter().map(|own| own.iter().chain(&values).copied().collect()).collect();
    let changed = torques(observations, &kinds, &parameters);
    let change: WhitenedTrials = whitened_change(observations, fit, base, &changed);
    let direction = tangent.whitened(tangent.project(&change));
    let size = (length(&change), length(&direction));
    Probe { direction, size }
}

fn length(direction: &WhitenedTrials) -> f64 {
    libm::sqrt(direction.iter().map(DVector::norm_squared).sum())
}

/// Score of `probe` on `residuals`, in standard errors. `unit` is the ratio of the variance of the residuals to that of the noise.
pub fn score(probe: &Probe, residuals: &WhitenedTrials, unit: f64) -> f64 {
    let squares: f64 = probe.size.1 * probe.size.1;
    let products: Vec<f64> = probe.direction.iter().zip(residuals).map(|(d, r)| d.dot(r)).collect();
    let sum: f64 = products.iter().sum();
    let multiple = sum / squares;
    let scatter: f64 = probe
        .direction
        .iter()
        .zip(&products)
        .map(|(d, product)| {
            let left = product - multiple * d.norm_squared();
            left * left
        })
        .sum();
    let variance = (unit * squares).max(scatter);
    sum / libm::sqrt(variance)
}
