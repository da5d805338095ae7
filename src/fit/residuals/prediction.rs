//! Prediction: simulates trials with given parameters, in parallel.

use rayon::prelude::*;

use crate::fit::data::observations::Observations;
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{SimulatedTorque, SimulationSettings, simulate, steps_per_sample};

/// Number of trials that one thread simulates at a time.
const BATCH: usize = 16;

/// Predicts the torque of `trials`, N m, with their further channels, and its derivatives with respect to the parameters `wanted`, into `response`.
///
/// `parameters` holds the parameter vectors of the trials, one after the other. `response` gets one row of values per trial, and
/// per trial one row of derivatives per value. The number of integration steps of a trial depends on its own parameters alone,
/// so its prediction depends neither on the other trials nor on the number of threads.
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
    let steps = |place: usize| {
        let input = &observations.trials[trials[place]].input;
        steps_per_sample(observations.lever, kinds, input, own(place), observations.period_s)
    };
    let mut order: Vec<(usize, usize)> = (0..trials.len()).map(|place| (steps(place), place)).collect();
    order.sort_unstable();
    let batches: Vec<&[(usize, usize)]> =
        order.chunk_by(|a, b| a.0 == b.0).flat_map(|same_steps| same_steps.chunks(BATCH)).collect();
    let run = |batch: &&[(usize, usize)]| {
        let request = SimulationSettings { derivatives: wanted, ..observations.request(kinds, batch[0].0) };
        let inputs: Vec<_> =
            batch.iter().map(|(_, place)| &observations.trials[trials[*place]].input).collect();
        let flat: Vec<f64> = batch.iter().flat_map(|(_, place)| own(*place)).copied().collect();
        let mut part = SimulatedTorque::default();
        simulate(&request, &inputs, &flat, &mut part);
        part
    };
    let parts: Vec<SimulatedTorque> = match batches.as_slice() {
        [one] => vec![run(one)],
        several => several.par_iter().map(run).collect(),
    };
    let (samples, slopes) = (observations.rows(), observations.rows() * wanted.len());
    response.torque_nm.resize(trials.len() * samples, 0.0);
    response.slopes.resize(trials.len() * slopes, 0.0);
    for (batch, part) in batches.iter().zip(&parts) {
        for (row, (_, place)) in batch.iter().enumerate() {
            response.torque_nm[place * samples..(place + 1) * samples]
                .copy_from_slice(&part.torque_nm[row * samples..(row + 1) * samples]);
            response.slopes[place * slopes..(place + 1) * slopes]
                .copy_from_slice(&part.slopes[row * slopes..(row + 1) * slopes]);
        }
    }
}
