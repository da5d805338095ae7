//! The parametric bootstrap: how the estimates scatter when the fitted session is measured again and again.

use rayon::prelude::*;

use super::resampling::{NoiseSampler, draw_observations};
use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::output::estimates::QUANTITIES;
use crate::random::Stream;

/// How many quantities are bootstrapped: all but the VAF, which is no property of the wrist.
const COUNT: usize = QUANTITIES.len() - 1;

/// Names of what is bootstrapped: the base parameters, then the quantities that follow from them.
pub const BOOTSTRAPPED_QUANTITIES: &[&str] = QUANTITIES.split_at(COUNT).0;

/// What the refits of a trial came to, by [`BOOTSTRAPPED_QUANTITIES`].
#[derive(Debug, Clone, PartialEq)]
pub struct BootstrapSpread {
    /// Standard deviation; absent where fewer than two refits have a value.
    pub sd: [Option<f64>; COUNT],
    /// 2.5th and 97.5th percentile.
    pub percentiles: [Option<[f64; 2]>; COUNT],
}

/// Refits `refits` sessions drawn from `fit`, and tells how each trial's values scatter. Empty without a measured noise.
///
/// Each refit has a random stream of its own, so the answer does not depend on the number of threads.
pub fn bootstrap(observations: &Observations, fit: &Fit, refits: usize, seed: u64) -> Vec<BootstrapSpread> {
    if fit.residual_covariances.is_empty() {
        return Vec::new();
    }
    let predicted: Vec<Vec<f64>> = crate::fit::fitted::uncertainty::predictions(observations, fit)
        .into_iter()
        .map(|own| own.torque_nm)
        .collect();
    let noise = NoiseSampler::new(fit);
    let drawn: Vec<Vec<[Option<f64>; COUNT]>> = (0..refits)
        .into_par_iter()
        .map(|number| {
            let mut stream = Stream::new(seed, &format!("fit/bootstrap/{number}"));
            let session = draw_observations(observations, &predicted, &noise, &mut stream);
            let refitted = fit.refitted(&session);
            (0..session.trials.len()).map(|trial| values(&session, &refitted, trial)).collect()
        })
        .collect();
    (0..observations.trials.len())
        .map(|trial| BootstrapSpread::of(drawn.iter().map(|refit| refit[trial])))
        .collect()
}

fn values(session: &Observations, fit: &Fit, trial: usize) -> [Option<f64>; COUNT] {
    let own = &fit.parameters[trial];
    let mut values = [None; COUNT];
    for (value, parameter) in values.iter_mut().zip(&own[..6]) {
        *value = Some(*parameter);
    }
    values[6] = Some(own[3] - own[4]);
    values[7] = fit.x_t_s(session, trial);
    values
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
            percentiles[quantity] = Some([0.025, 0.975].map(|part| percentile(&values, part)));
        }
        Self { sd, percentiles }
    }
}

/// The percentile of sorted values, with a straight line between neighbours.
fn percentile(sorted: &[f64], part: f64) -> f64 {
    let place = part * (sorted.len() - 1) as f64;
    let below = libm::floor(place) as usize;
    let above = (below + 1).min(sorted.len() - 1);
    sorted[below] + (place - below as f64) * (sorted[above] - sorted[below])
}
