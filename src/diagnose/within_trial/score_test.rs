//! Screening: what each mechanism would explain of the residuals, once the free parameters have absorbed their share.

use nalgebra::DVector;

use super::residual_projection::{Direction, Tangent, whiten};
use crate::diagnose::applicability::missing;
use crate::diagnose::predicted_torque::torques;
use crate::fit::{Fit, Observations};
use crate::wrist::mechanisms::{CATALOGUE, EvidenceSource, MechanismClass, MechanismKind, ProbeContext};

/// A mechanism looked at with given values.
#[derive(Debug, Clone)]
pub struct Probe {
    /// Which mechanism.
    pub kind: MechanismKind,
    /// Its values.
    pub values: Vec<f64>,
    /// What it changes, whitened, less what the free parameters absorb.
    pub direction: Direction,
    /// Length of the change before, and after, the absorption, in units of the noise.
    pub size: (f64, f64),
}

/// A mechanism that this session cannot tell about.
#[derive(Debug, Clone, PartialEq)]
pub struct Unseen {
    /// Which.
    pub kind: MechanismKind,
    /// Why.
    pub reason: String,
}

/// Least length of a typical effect that is left after the absorption, in units of the noise, to be visible.
const VISIBLE: f64 = 0.5;

/// The probes of the whole catalogue within the trace, and what cannot be seen there.
pub fn probes(prepared: &Observations, fit: &Fit, tangent: &Tangent) -> (Vec<Probe>, Vec<Unseen>) {
    let highest = prepared.trials.iter().map(|trial| {
        let change = trial.measured_nm.iter().copied().fold(0.0, f64::max);
        change + trial.direction * trial.torque_0_nm
    });
    let session = ProbeContext { lever: prepared.lever, highest_torque_nm: highest.fold(0.0, f64::max) };
    let base = torques(prepared, &fit.kinds, &fit.parameters);
    let (mut found, mut unseen) = (Vec::new(), Vec::new());
    for kind in CATALOGUE.iter().copied().filter(|kind| !fit.kinds.contains(kind)) {
        if let Some(reason) = missing(prepared, kind) {
            unseen.push(Unseen { kind, reason });
            continue;
        }
        if !matches!(kind.evidence(), EvidenceSource::Trace | EvidenceSource::AcrossTrials) {
            continue;
        }
        let mut largest = (0.0, 0.0);
        for values in kind.probes(&session) {
            let probe = probe(prepared, fit, tangent, &base, kind, values);
            if probe.size.1 > largest.1 || largest.1 == 0.0 {
                largest = probe.size;
            }
            // A direction that is nearly all absorbed is rounding error.
            if probe.size.1.is_finite() && probe.size.1 > 1e-3 * probe.size.0 && probe.size.1 > VISIBLE * 0.1
            {
                found.push(probe);
            }
        }
        if largest.1 < VISIBLE && kind.class() != MechanismClass::Trial {
            unseen.push(Unseen {
                kind,
                reason: format!(
                    "a typical size of it is worth {:.1} standard deviations of the noise here, and {:.2} after the \
                     free parameters have absorbed their part",
                    largest.0, largest.1
                ),
            });
        }
    }
    (found, unseen)
}

fn probe(
    prepared: &Observations,
    fit: &Fit,
    tangent: &Tangent,
    base: &[Vec<f64>],
    kind: MechanismKind,
    values: Vec<f64>,
) -> Probe {
    let mut kinds = fit.kinds.clone();
    kinds.push(kind);
    let parameters: Vec<Vec<f64>> =
        fit.parameters.iter().map(|own| own.iter().chain(&values).copied().collect()).collect();
    let changed = torques(prepared, &kinds, &parameters);
    let change: Direction = (0..base.len())
        .map(|trial| {
            let by: Vec<f64> = changed[trial].iter().zip(&base[trial]).map(|(to, from)| to - from).collect();
            whiten(prepared, fit, trial, &by)
        })
        .collect();
    let direction = tangent.project(&change);
    let size = (length(&change), length(&direction));
    Probe { kind, values, direction, size }
}

fn length(direction: &Direction) -> f64 {
    libm::sqrt(direction.iter().map(DVector::norm_squared).sum())
}

/// What `probe` finds in `residuals`, whose variance is `unit` times what the noise says.
pub fn score(probe: &Probe, residuals: &Direction, unit: f64) -> f64 {
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
