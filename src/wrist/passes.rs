//! The passes over a batch of trials, each with the type of number that has its derivatives.

use super::base_trials::base;
use super::batch::{Batch, MAX_DERIVATIVES};
use super::extended::extended;
use super::linear_response::LINEAR_PARAMETERS;
use super::simulation::{SimulatedTorque, SimulationSettings};
use crate::number::Plain;

/// The ranges of [`SimulationSettings::derivatives`] that one pass each computes. Without derivatives there is one pass.
pub(super) fn passes(settings: &SimulationSettings) -> Vec<std::ops::Range<usize>> {
    let mut passes = Vec::new();
    let (mut begin, mut linear) = (0, 0);
    for (place, parameter) in settings.derivatives.iter().enumerate() {
        let is_linear = *parameter < LINEAR_PARAMETERS;
        let (linear_after, count) = (linear + usize::from(is_linear), place + 1 - begin);
        let fits = match linear_after {
            _ if alters_linear_part(settings) => count <= MAX_DERIVATIVES,
            _ => count - linear_after <= MAX_DERIVATIVES - LINEAR_PARAMETERS,
        };
        linear = linear_after;
        if !fits {
            passes.push(begin..place);
            (begin, linear) = (place, usize::from(is_linear));
        }
    }
    passes.push(begin..settings.derivatives.len());
    passes
}

/// Whether a mechanism alters the linear part of the model, which then has the derivatives of all parameters.
fn alters_linear_part(settings: &SimulationSettings) -> bool {
    settings.kinds.iter().any(|kind| kind.alters_linear_part())
}

/// Simulates the batch with the smallest number type that has the derivatives of this pass.
#[inline(always)]
pub(super) fn run<P: Plain>(batch: &Batch, response: &mut SimulatedTorque) {
    match (batch.settings.kinds.is_empty(), batch.settings.lever) {
        (true, None) => without_mechanisms::<P, 2>(batch, response),
        (true, Some(_)) => without_mechanisms::<P, 4>(batch, response),
        (false, _) => with_mechanisms::<P>(batch, response),
    }
}

#[inline(always)]
fn without_mechanisms<P: Plain, const STATES: usize>(batch: &Batch, response: &mut SimulatedTorque) {
    match batch.wanted.len() {
        0 => base::<P, STATES, 0, 0>(batch, response),
        _ => base::<P, STATES, 4, 6>(batch, response),
    }
}

/// The results have the same bits with every type of number that has the derivatives.
#[inline(always)]
fn with_mechanisms<P: Plain>(batch: &Batch, response: &mut SimulatedTorque) {
    if batch.wanted.is_empty() {
        extended::<P, 0, 0>(batch, response);
    } else if P::LANES == 1 || alters_linear_part(batch.settings) {
        extended::<P, 9, 9>(batch, response);
    } else if batch.slots_in_use() <= 7 {
        // Most mechanisms have one parameter that is estimated.
        extended::<P, 4, 7>(batch, response);
    } else {
        extended::<P, 4, 9>(batch, response);
    }
}
