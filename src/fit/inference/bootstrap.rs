//! Parametric bootstrap: the spread of the estimates over simulated sessions.

use rayon::prelude::*;

use super::resampling::{NoiseSampler, draw_observations};
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::predictions;
use crate::fit::fitted::quantities::QUANTITIES;
use crate::fit::model::parameter_index::{K_DEC, K_SRS};
use crate::fit::search::refit_search::RefitSearch;
use crate::random::Stream;
use crate::wrist::BASE_PARAMETERS;

/// Number of bootstrapped quantities: all but the VAF, which is no property of the wrist.
const COUNT: usize = QUANTITIES.len() - 1;

/// Names of the bootstrapped quantities: the base parameters, then the quantities that follow from them.
pub const BOOTSTRAPPED_QUANTITIES: &[&str] = QUANTITIES.split_at(COUNT).0;

/// Spread of the quantities of one trial over the bootstrap, in the order of [`BOOTSTRAPPED_QUANTITIES`].
#[derive(Debug, Clone, PartialEq)]
pub struct BootstrapSpread {
    /// Standard deviation; `None` if fewer than two refits have a value.
    pub sd: [Option<f64>; COUNT],
    /// 2.5th and 97.5th percentile; `None` if fewer than two refits have a value.
    pub percentiles: [Option<[f64; 2]>; COUNT],
}

/// Simulates `refits` sessions from `fit`, refits each, and returns the spread of each trial; empty if the covariance of the residuals
/// is unknown.
///
/// Each refit has its own random stream, so the result does not depend on the number of threads.
pub fn bootstrap(observations: &Observations, fit: &Fit, refits: usize, seed: u64) -> Vec<BootstrapSpread> {
    bootstrap_watched(observations, fit, refits, seed, || ())
}

/// As [`bootstrap`], calling `begins` before each refit. A program that has to stop in between does so by unwinding from there.
pub fn bootstrap_watched(
    observations: &Observations,
    fit: &Fit,
    refits: usize,
    seed: u64,
    begins: impl Fn() + Sync,
) -> Vec<BootstrapSpread> {
    if fit.residual_covariances.is_empty() {
        return Vec::new();
    }
    let predicted: Vec<Vec<f64>> =
        predictions(observations, fit).into_iter().map(|own| own.torque_nm).collect();
    let noise = NoiseSampler::new(&fit.residual_covariances);
    let search = RefitSearch::new(observations, fit);
    let drawn: Vec<Vec<[Option<f64>; COUNT]>> = (0..refits)
        .into_par_iter()
        .map(|number| {
            begins();
            let mut stream = Stream::new(seed, &format!("fit/bootstrap/{number}"));
            let session = draw_observations(observations, &predicted, &noise, &mut stream);
            let refitted = search.refit(&session);
            (0..session.trials.len()).map(|trial| quantities(&session, &refitted, trial)).collect()
        })
        .collect();
    (0..observations.trials.len())
        .map(|trial| BootstrapSpread::of(drawn.iter().map(|refit| refit[trial])))
        .collect()
}

/// The bootstrapped quantities of a trial.
fn quantities(session: &Observations, fit: &Fit, trial: usize) -> [Option<f64>; COUNT] {
    let own = &fit.parameters[trial];
    let mut quantities = [None; COUNT];
    for (quantity, parameter) in quantities.iter_mut().zip(&own[..BASE_PARAMETERS.len()]) {
        *quantity = Some(*parameter);
    }
    quantities[6] = Some(own[K_SRS] - own[K_DEC]);
    quantities[7] = fit.x_t_s(session, trial);
    quantities
}

impl BootstrapSpread {
    fn of(refits: impl Iterator<Item = [Option<f64>; COUNT]> + Clone) -> Self {
        let (mut sd, mut percentiles) = ([None; COUNT], [None; COUNT]);
        for quantity in 0..COUNT {
            let mut values: Vec<f64> = refits.clone().filter_map(|own| own[quantity]).collect();
            values.sort_by(f64::total_cmp);
            if values.len() < 2 {
                continue;
            }
            let count = values.len() as f64;
            let mean = values.iter().sum::<f64>() / count;
            let squares = values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>();
            sd[quantity] = Some(libm::sqrt(squares / (count - 1.0)));
            percentiles[quantity] = Some([0.025, 0.975].map(|fraction| percentile(&values, fraction)));
        }
        Self { sd, percentiles }
    }
}

/// The percentile of sorted values, linearly interpolated between neighbours.
fn percentile(sorted: &[f64], fraction: f64) -> f64 {
    let rank = fraction * (sorted.len() - 1) as f64;
    let below = libm::floor(rank) as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (rank - below as f64) * (sorted[above] - sorted[below])
}
