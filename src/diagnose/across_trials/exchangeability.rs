//! Whether the stiffnesses of the trials still differ from their conditions in a way that goes with order, rest or EMG: a permutation test.

use nalgebra::DVector;

use super::stiffness_table::MIN_DEGREES_OF_FREEDOM;
use crate::diagnose::evidence::model_posterior::ModelPosterior;
use crate::fit::{K_SRS, Observations};
use crate::random::Stream;
use crate::statistics::group_indices;
use crate::wrist::mechanisms::Covariates;

/// Number of permutations: p-values of 0.001 can be told.
const PERMUTATIONS: usize = 1999;

const TRIAL_COVARIATES: [fn(&Covariates) -> f64; 4] =
    [|own| own.progress, |own| own.rest_s, |own| own.flexor_emg_excess_mvc, |own| own.extensor_emg_mvc];

/// Probability that trials which differ by chance alone show a correlation at least as large with any covariate; `None` where too few
/// trials are repeated.
///
/// The deviations of k_srs within a condition are exchangeable if nothing goes with the covariates. Between conditions they are not: both a
/// stiffness and an EMG vary more where the torque is larger.
pub fn remaining_correlation(
    observations: &Observations,
    posterior: &ModelPosterior,
    seed: u64,
) -> Option<f64> {
    let count = observations.trials.len();
    let groups: Vec<Vec<usize>> =
        group_indices(count, |trial| observations.trials[trial].condition).into_values().collect();
    if ((count - groups.len()) as f64) < MIN_DEGREES_OF_FREEDOM {
        return None;
    }
    let centred = |values: Vec<f64>| -> Option<DVector<f64>> {
        let mut own = DVector::from_vec(values);
        for trials in &groups {
            let mean = trials.iter().map(|trial| own[*trial]).sum::<f64>() / trials.len() as f64;
            trials.iter().for_each(|trial| own[*trial] -= mean);
        }
        let norm = own.norm();
        (norm > 1e-9).then(|| own / norm)
    };
    // Of the other parameters, those of one repetition have errors in common, through I_j.
    let stiffness = posterior.unknowns.parameters.iter().position(|own| *own == K_SRS)?;
    let deviation = centred(posterior.point.own.iter().map(|own| own[stiffness]).collect())?;
    let covariates: Vec<DVector<f64>> = TRIAL_COVARIATES
        .iter()
        .filter_map(|read| {
            centred(observations.trials.iter().map(|own| read(&own.input.covariates)).collect())
        })
        .collect();
    let largest = |order: &[usize]| {
        let product = |covariate: &DVector<f64>| {
            let terms = order.iter().enumerate().map(|(place, from)| deviation[*from] * covariate[place]);
            terms.sum::<f64>().abs()
        };
        covariates.iter().map(product).fold(0.0, f64::max)
    };
    let mut order: Vec<usize> = (0..count).collect();
    let observed = largest(&order);
    let mut stream = Stream::new(seed, "exchangeable trials");
    let mut reached = 0;
    for _ in 0..PERMUTATIONS {
        for trials in &groups {
            let mut shuffled = trials.clone();
            stream.shuffle(&mut shuffled);
            trials.iter().zip(shuffled).for_each(|(trial, from)| order[*trial] = from);
        }
        if largest(&order) >= observed {
            reached += 1;
        }
    }
    Some((reached + 1) as f64 / (PERMUTATIONS + 1) as f64)
}
