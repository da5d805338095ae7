//! The torques that the model predicts for trials of a session.

use rayon::prelude::*;

use crate::fit::data::preprocessing::Observations;
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{SimulatedTorque, SimulationSettings, simulate, substeps};

/// Trials that one thread takes through the model at a time.
const SHARE: usize = 16;

/// Predicted torques of some trials, and derivatives with respect to the parameters `wanted`.
///
/// Each trial gets the integration steps that its own parameters ask for, so its prediction does not depend on which others
/// are asked for with it, nor on how many threads there are.
pub fn predict(
    observations: &Observations,
    kinds: &[MechanismKind],
    wanted: &[usize],
    trials: &[usize],
    parameters: &[f64],
    response: &mut SimulatedTorque,
) {
    let count = parameters.len() / trials.len().max(1);
    let own = |place: usize| &parameters[place * count..(place + 1) * count];
    // In powers of two, so that a small step of the parameters seldom changes the integrator and few groups come of it.
    let steps =
        |place: usize| substeps(observations.lever, own(place), observations.period_s).next_power_of_two();
    let mut order: Vec<(usize, usize)> = (0..trials.len()).map(|place| (steps(place), place)).collect();
    order.sort_unstable();
    let shares: Vec<&[(usize, usize)]> =
        order.chunk_by(|a, b| a.0 == b.0).flat_map(|alike| alike.chunks(SHARE)).collect();
    let run = |share: &&[(usize, usize)]| {
        let request = SimulationSettings { derivatives: wanted, ..observations.request(kinds, share[0].0) };
        let inputs: Vec<_> =
            share.iter().map(|(_, place)| &observations.trials[trials[*place]].input).collect();
        let flat: Vec<f64> = share.iter().flat_map(|(_, place)| own(*place)).copied().collect();
        let mut part = SimulatedTorque::default();
        simulate(&request, &inputs, &flat, &mut part);
        part
    };
    let parts: Vec<SimulatedTorque> = match shares.as_slice() {
        [one] => vec![run(one)],
        ambiguous_trials => ambiguous_trials.par_iter().map(run).collect(),
    };
    let (samples, slopes) = (observations.samples, observations.samples * wanted.len());
    response.torque_nm.resize(trials.len() * samples, 0.0);
    response.slopes.resize(trials.len() * slopes, 0.0);
    for (share, part) in shares.iter().zip(&parts) {
        for (row, (_, place)) in share.iter().enumerate() {
            response.torque_nm[place * samples..(place + 1) * samples]
                .copy_from_slice(&part.torque_nm[row * samples..(row + 1) * samples]);
            response.slopes[place * slopes..(place + 1) * slopes]
                .copy_from_slice(&part.slopes[row * slopes..(row + 1) * slopes]);
        }
    }
}
