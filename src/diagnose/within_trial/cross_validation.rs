//! Cross-validation: improvement by an added mechanism on trials that it was not fitted to.

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

/// Improvement by the last mechanism of `after`, which extends `before`, and the decrease of the whitened sum of squares on the
/// repetitions left out (chi-square units).
///
/// The mechanism's values are fitted to the other trials and held; the wrist's parameters are free in the trials left out, with and
/// without the mechanism, so that the comparison concerns the mechanism alone. Confidence intervals resample trials.
pub fn gain(observations: &Observations, before: &Fit, after: &Fit, seed: u64) -> (Gain, f64) {
    let without = ResidualSquares::of(observations, before);
    let part = parts(&observations.trials.iter().map(|trial| trial.repetition).collect::<Vec<_>>());
    let keys: [Box<dyn Fn(usize) -> i64>; 3] = [
        Box::new(|trial| part[trial]),
        Box::new(|trial| (observations.trials[trial].velocity_rad_s * 1e6) as i64),
        Box::new(|trial| (observations.trials[trial].torque_nm * 1e6) as i64),
    ];
    let held_out: Vec<Option<ResidualSquares>> =
        keys.iter().map(|key| held_out_squares(observations, after, key)).collect();
    let ratio_of = |(index, with): (usize, &Option<ResidualSquares>)| {
        let mut stream = Stream::new(seed, &format!("gain/{index}/{}", after.kinds.len()));
        with.as_ref().map(|with| ratio(&with.of_trials, &without.of_trials, &mut stream))
    };
    let ratios: Vec<Option<Ratio>> = held_out.iter().enumerate().map(ratio_of).collect();
    let loss = held_out[0].as_ref().map_or(f64::NAN, |with| without.weighed - with.weighed);
    let unknown = Ratio { value: f64::NAN, low: f64::NAN, high: f64::NAN };
    let gain = Gain {
        held_out_rmse_ratio: ratios[0].unwrap_or(unknown),
        held_out_velocity_rmse_ratio: ratios[1],
        held_out_torque_rmse_ratio: ratios[2],
        vaf_before: mean_vaf(observations, before),
        vaf_after: mean_vaf(observations, after),
    };
    (gain, loss)
}

/// Improvement by removing hum from the record: fits of the same model with and without hum. Hum is estimated in the holds, so that
/// every ramp is data left out.
pub fn hum_removal_gain(with: (&Observations, &Fit), without: (&Observations, &Fit), seed: u64) -> Gain {
    let (before, after) =
        (ResidualSquares::of(with.0, with.1).of_trials, ResidualSquares::of(without.0, without.1).of_trials);
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

/// Squared residuals of a fit.
struct ResidualSquares {
    /// Mean squared residual of the torque of each trial, (N m)^2.
    of_trials: Vec<f64>,
    /// Whitened sum of squares of all trials (chi-square units).
    weighed: f64,
}

impl ResidualSquares {
    fn of(observations: &Observations, fit: &Fit) -> Self {
        let residuals = residuals(observations, fit);
        let mean = |own: &Vec<f64>| {
            let torque = observations.torque_of(own);
            torque.iter().map(|e| e * e).sum::<f64>() / torque.len() as f64
        };
        let weighed = |(trial, own): (usize, &Vec<f64>)| {
            fit.objective.whiten(observations.noise_index[trial], own).norm_squared()
        };
        Self {
            of_trials: residuals.iter().map(mean).collect(),
            weighed: residuals.iter().enumerate().map(weighed).sum(),
        }
    }
}

/// Squared residuals of each trial, with the mechanism fitted to the trials with another key; `None` with one key or too many.
fn held_out_squares(
    observations: &Observations,
    after: &Fit,
    key: &dyn Fn(usize) -> i64,
) -> Option<ResidualSquares> {
    let folds = group_indices(observations.trials.len(), key);
    if !(2..=MAX_FOLDS).contains(&folds.len()) {
        return None;
    }
    let mut result = ResidualSquares { of_trials: vec![0.0; observations.trials.len()], weighed: 0.0 };
    for (held, out) in folds {
        let rest: Vec<usize> = (0..observations.trials.len()).filter(|trial| key(*trial) != held).collect();
        let others = after.extended_on_subset(&observations.subset(&rest), &rest, &after.model);
        let held_out = observations.subset(&out);
        let own = after.extended_on_subset(&held_out, &out, &held_model(&others));
        let left = ResidualSquares::of(&held_out, &own);
        for (trial, square) in out.into_iter().zip(left.of_trials) {
            result.of_trials[trial] = square;
        }
        result.weighed += left.weighed;
    }
    Some(result)
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
