//! Cross-validation: improvement by an added mechanism on trials that it was not fitted to.

use std::collections::BTreeMap;

use crate::diagnose::predicted_torque::{mean_vaf, residuals};
use crate::fit::{Fit, Model, Observations, Scope};
use crate::random::Stream;
use crate::statistics::group_indices;

/// A ratio with its 95 % confidence interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Ratio {
    /// The ratio.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end of the interval.
    pub high: f64,
}

/// Improvement of the fit by an added mechanism.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Gain {
    /// Root-mean-square residual with the mechanism relative to that without, on repetitions left out of the fit.
    pub held_out_rmse_ratio: Ratio,
    /// Same ratio on velocities left out; `None` with one velocity or too many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_velocity_rmse_ratio: Option<Ratio>,
    /// Same ratio on torques left out; `None` with one torque or too many.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_torque_rmse_ratio: Option<Ratio>,
    /// Mean variance accounted for (VAF) without the mechanism.
    pub vaf_before: f64,
    /// Mean VAF with the mechanism.
    pub vaf_after: f64,
}

impl Gain {
    /// What must be said of a mechanism of this title that makes the prediction of repetitions left out worse, beyond chance.
    pub fn warning(&self, title: &str) -> Option<String> {
        let Ratio { value, low, high } = self.held_out_rmse_ratio;
        (low > 1.0).then(|| {
            format!(
                "{title}: repetitions left out of its fit are predicted worse with it than without it (residual {value:.3} times as \
                 large, 95 % interval {low:.3} to {high:.3}): it stands in for something else"
            )
        })
    }
}

/// Improvement by the last mechanism of `after`, which extends `before`.
///
/// The values of mechanisms are fitted to the other trials and held; the wrist's parameters are free in the trials left out. That is done
/// with and without the mechanism, so that the comparison concerns the mechanism alone. Confidence intervals resample trials.
pub fn gain(observations: &Observations, before: &Fit, after: &Fit, seed: u64) -> Gain {
    let part = parts(&observations.trials.iter().map(|trial| trial.repetition).collect::<Vec<_>>());
    let part_of = |trial: usize| part[trial];
    let velocity_of = |trial: usize| (observations.trials[trial].velocity_rad_s * 1e6) as i64;
    let torque_of = |trial: usize| (observations.trials[trial].torque_nm * 1e6) as i64;
    let keys: [&dyn Fn(usize) -> i64; 3] = [&part_of, &velocity_of, &torque_of];
    let ratio_of = |(index, key): (usize, &dyn Fn(usize) -> i64)| {
        let folds = group_indices(observations.trials.len(), key);
        let [with, without] = [after, before].map(|fit| held_out_squares(observations, fit, &folds));
        let mut stream = Stream::new(seed, &format!("gain/{index}/{}", after.kinds.len()));
        Some(ratio(&with?, &without?, &mut stream))
    };
    let ratios: Vec<Option<Ratio>> = keys.into_iter().enumerate().map(ratio_of).collect();
    let unknown = Ratio { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    Gain {
        held_out_rmse_ratio: ratios[0].unwrap_or(unknown),
        held_out_velocity_rmse_ratio: ratios[1],
        held_out_torque_rmse_ratio: ratios[2],
        vaf_before: mean_vaf(observations, before),
        vaf_after: mean_vaf(observations, after),
    }
}

/// Improvement by removing hum from the record: fits of the same model with and without hum. Hum is estimated in the holds, so that
/// every ramp is data left out.
pub fn hum_removal_gain(with: (&Observations, &Fit), without: (&Observations, &Fit), seed: u64) -> Gain {
    let [before, after] = [with, without].map(|(observations, fit)| residual_squares(observations, fit));
    let held_out_rmse_ratio = ratio(&after, &before, &mut Stream::new(seed, "gain/hum"));
    Gain {
        held_out_rmse_ratio,
        held_out_velocity_rmse_ratio: None,
        held_out_torque_rmse_ratio: None,
        vaf_before: mean_vaf(with.0, with.1),
        vaf_after: mean_vaf(without.0, without.1),
    }
}

/// Largest number of cross-validation folds; each costs two fits.
const MAX_FOLDS: usize = 12;

/// The fold in which each trial is left out: its repetition, several repetitions where there are many, and every third trial where
/// there is one repetition.
fn parts(repetitions: &[u32]) -> Vec<i64> {
    let groups = group_indices(repetitions.len(), |trial| repetitions[trial]);
    let distinct: Vec<u32> = groups.into_keys().collect();
    let part = |(trial, own): (usize, &u32)| match distinct.as_slice() {
        [_] => trial % 3,
        several => several.binary_search(own).unwrap_or(0) % MAX_FOLDS,
    };
    repetitions.iter().enumerate().map(|own| part(own) as i64).collect()
}

/// Mean squared residual of the torque of each trial, (N m)^2.
fn residual_squares(observations: &Observations, fit: &Fit) -> Vec<f64> {
    let mean = |own: &Vec<f64>| {
        let torque = observations.torque_of(own);
        torque.iter().map(|e| e * e).sum::<f64>() / torque.len() as f64
    };
    residuals(observations, fit).iter().map(mean).collect()
}

/// Mean squared residual of each trial, (N m)^2, with the mechanisms of `fit` fitted to the trials of the other folds; `None` with one
/// fold or too many.
fn held_out_squares(
    observations: &Observations,
    fit: &Fit,
    folds: &BTreeMap<i64, Vec<usize>>,
) -> Option<Vec<f64>> {
    if !(2..=MAX_FOLDS).contains(&folds.len()) {
        return None;
    }
    // Shrinkage is towards the wrist's values in another fit.
    let fit = Fit { shrinkage_target: None, ..fit.clone() };
    let mut squares = vec![0.0; observations.trials.len()];
    for out in folds.values() {
        let rest: Vec<usize> = (0..squares.len()).filter(|trial| !out.contains(trial)).collect();
        let model = if fit.kinds.is_empty() {
            fit.model.clone()
        } else {
            held_model(&fit.extended_on_subset(&observations.subset(&rest), &rest, &fit.model))
        };
        let held_out = observations.subset(out);
        let own = fit.extended_on_subset(&held_out, out, &model);
        for (trial, square) in out.iter().zip(residual_squares(&held_out, &own)) {
            squares[*trial] = square;
        }
    }
    Some(squares)
}

/// The model of `fit` with its mechanisms fixed at the fitted values.
fn held_model(fit: &Fit) -> Model {
    let mut model = fit.model.clone();
    let ranges = model.mechanism_ranges();
    for (added, range) in model.mechanisms.iter_mut().zip(ranges) {
        for (spec, value) in added.parameters.iter_mut().zip(&fit.parameters[0][range]) {
            spec.scope = Scope::Fixed;
            spec.value = Some(*value);
            spec.law.clear();
        }
    }
    model
}

/// Square root of the ratio of sums, with a bootstrap interval over trials.
fn ratio(with: &[f64], without: &[f64], stream: &mut Stream) -> Ratio {
    let count = with.len();
    let of = |trials: &[usize]| {
        let sum = |values: &[f64]| trials.iter().map(|trial| values[*trial]).sum::<f64>();
        libm::sqrt(sum(with) / sum(without).max(1e-30))
    };
    let all: Vec<usize> = (0..count).collect();
    let mut drawn: Vec<f64> = (0..500)
        .map(|_| of(&(0..count).map(|_| stream.below(count as u64) as usize).collect::<Vec<_>>()))
        .collect();
    drawn.sort_by(f64::total_cmp);
    Ratio { value: of(&all), low: drawn[12], high: drawn[487] }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// With more than twelve repetitions, and with one, an earlier version reported a ratio of 1.000 that was not computed.
    #[test]
    fn each_trial_is_left_out_once_and_most_stay_for_any_number_of_repetitions() {
        for count in [1, 2, 3, 12, 13, 46] {
            let repetitions: Vec<u32> = (0..4 * count).map(|trial| trial % count + 1).collect();
            let parts = parts(&repetitions);
            let mut distinct = parts.clone();
            distinct.sort_unstable();
            distinct.dedup();
            assert!((2..=MAX_FOLDS).contains(&distinct.len()), "{count} repetitions: {parts:?}");
            let largest = distinct.iter().map(|own| parts.iter().filter(|part| *part == own).count()).max();
            assert!(
                largest.is_some_and(|largest| 2 * largest <= parts.len()),
                "{count} repetitions: {parts:?}"
            );
        }
    }

    #[test]
    fn a_mechanism_that_predicts_worse_beyond_chance_is_said_to_stand_in_for_something_else() {
        let gain = |low: f64| Gain {
            held_out_rmse_ratio: Ratio { value: 1.05, low, high: 1.1 },
            held_out_velocity_rmse_ratio: None,
            held_out_torque_rmse_ratio: None,
            vaf_before: 0.9,
            vaf_after: 0.9,
        };
        let said = gain(1.01).warning("delay of the torque").unwrap();
        assert!(
            said.starts_with("delay of the torque: repetitions left out") && said.contains("1.010 to 1.100"),
            "{said}"
        );
        assert_eq!(gain(0.99).warning("delay of the torque"), None);
    }
}
