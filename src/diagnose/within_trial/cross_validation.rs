//! What an extension gains on data that it was not fitted to.

use super::residual_projection::whiten;
use crate::diagnose::predicted_torque::{mean_vaf, residuals};
use crate::fit::{Fit, Model, Observations, Scope};
use crate::random::Stream;
use crate::statistics::group_indices;
use crate::wrist::BASE_PARAMETERS;

/// A ratio with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Ratio {
    /// The ratio.
    pub value: f64,
    /// Lower end of the interval.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// What an extension gains.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Gain {
    /// Root mean square residual with the extension over that without, on repetitions left out.
    pub held_out_rmse_ratio: Ratio,
    /// The same on velocities left out; absent where there is only one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_velocity_rmse_ratio: Option<Ratio>,
    /// The same on torques left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub held_out_torque_rmse_ratio: Option<Ratio>,
    /// Mean variance accounted for, without and with.
    pub vaf_before: f64,
    /// With the extension.
    pub vaf_after: f64,
}

/// The gain of `after`, which adds its last mechanism to `before`, and what the sum of squares of the repetitions left out loses by it,
/// in units of the noise.
///
/// The mechanism's values come from the other trials and are held; the wrist's own parameters are free in the trials left
/// out, with the extension and without, so that what is compared is the mechanism alone. Intervals resample trials.
pub fn gain(prepared: &Observations, before: &Fit, after: &Fit, seed: u64) -> (Gain, f64) {
    let without = Squares::of(prepared, before);
    let part = parts(&prepared.trials.iter().map(|trial| trial.repetition).collect::<Vec<_>>());
    let keys: [Box<dyn Fn(usize) -> i64>; 3] = [
        Box::new(|trial| part[trial]),
        Box::new(|trial| (prepared.trials[trial].velocity_rad_s * 1e6) as i64),
        Box::new(|trial| (prepared.trials[trial].torque_nm * 1e6) as i64),
    ];
    let held_out: Vec<Option<Squares>> =
        keys.iter().map(|key| held_out_squares(prepared, after, key)).collect();
    let ratio_of = |(index, with): (usize, &Option<Squares>)| {
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
        vaf_before: mean_vaf(prepared, before),
        vaf_after: mean_vaf(prepared, after),
    };
    (gain, loss)
}

/// The gain of taking hum out of the record: `without` it a fit of the same model leaves less. It was found in the holds, so
/// every ramp is data held out.
pub fn gain_of_cleaning(with: (&Observations, &Fit), without: (&Observations, &Fit), seed: u64) -> Gain {
    let (before, after) =
        (Squares::of(with.0, with.1).of_trials, Squares::of(without.0, without.1).of_trials);
    let held_out_rmse_ratio = ratio(&after, &before, &mut Stream::new(seed, "gain/hum"));
    Gain {
        held_out_rmse_ratio,
        held_out_velocity_rmse_ratio: None,
        held_out_torque_rmse_ratio: None,
        vaf_before: mean_vaf(with.0, with.1),
        vaf_after: mean_vaf(without.0, without.1),
    }
}

/// Most parts that are left out in turn: each costs two fits.
const MOST_PARTS: usize = 12;

/// The part of the session that each trial is left out with: its repetition; several repetitions where there are many, and
/// every third trial where there is one.
fn parts(repetitions: &[u32]) -> Vec<i64> {
    let groups = group_indices(repetitions.len(), |trial| repetitions[trial]);
    let distinct: Vec<u32> = groups.into_keys().collect();
    let part = |(trial, own): (usize, &u32)| match distinct.as_slice() {
        [_] => trial % 3,
        several => several.binary_search(own).unwrap_or(0) % MOST_PARTS,
    };
    repetitions.iter().enumerate().map(|own| part(own) as i64).collect()
}

/// What a fit leaves.
struct Squares {
    /// Each trial's mean squared residual, (N m)^2.
    of_trials: Vec<f64>,
    /// The sum of all squares in units of the noise.
    weighed: f64,
}

impl Squares {
    fn of(prepared: &Observations, fit: &Fit) -> Self {
        let residuals = residuals(prepared, fit);
        let mean = |own: &Vec<f64>| own.iter().map(|e| e * e).sum::<f64>() / own.len() as f64;
        let weighed = |(trial, own): (usize, &Vec<f64>)| whiten(prepared, fit, trial, own).norm_squared();
        Self {
            of_trials: residuals.iter().map(mean).collect(),
            weighed: residuals.iter().enumerate().map(weighed).sum(),
        }
    }
}

/// What is left of each trial where the mechanism was fitted to the trials with another key.
fn held_out_squares(prepared: &Observations, after: &Fit, key: &dyn Fn(usize) -> i64) -> Option<Squares> {
    let folds = group_indices(prepared.trials.len(), key);
    if !(2..=MOST_PARTS).contains(&folds.len()) {
        return None;
    }
    let mut result = Squares { of_trials: vec![0.0; prepared.trials.len()], weighed: 0.0 };
    for (held, out) in folds {
        let rest: Vec<usize> = (0..prepared.trials.len()).filter(|trial| key(*trial) != held).collect();
        let others = after.on(&prepared.subset(&rest), &rest, &after.model);
        let held_out = prepared.subset(&out);
        let own = after.on(&held_out, &out, &held_model(&others));
        let left = Squares::of(&held_out, &own);
        for (trial, square) in out.into_iter().zip(left.of_trials) {
            result.of_trials[trial] = square;
        }
        result.weighed += left.weighed;
    }
    Some(result)
}

/// The model of `fit` with its mechanisms held at the values found.
fn held_model(fit: &Fit) -> Model {
    let mut model = fit.model.clone();
    let mut index = BASE_PARAMETERS.len();
    for switched in &mut model.mechanisms {
        for treatment in &mut switched.parameters {
            treatment.scope = Scope::Fixed;
            treatment.value = Some(fit.parameters[0][index]);
            treatment.law.clear();
            index += 1;
        }
    }
    model
}

/// Root of the ratio of sums, with an interval over trials drawn with replacement.
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

    /// Of more than twelve repetitions, and of one, a ratio of 1.000 was once written without having been measured.
    #[test]
    fn however_many_repetitions_there_are_each_trial_is_left_out_once_and_most_stay() {
        for count in [1, 2, 3, 12, 13, 46] {
            let repetitions: Vec<u32> = (0..4 * count).map(|trial| trial % count + 1).collect();
            let parts = parts(&repetitions);
            let mut distinct = parts.clone();
            distinct.sort_unstable();
            distinct.dedup();
            assert!((2..=MOST_PARTS).contains(&distinct.len()), "{count} repetitions: {parts:?}");
            let largest = distinct.iter().map(|own| parts.iter().filter(|part| *part == own).count()).max();
            assert!(
                largest.is_some_and(|largest| 2 * largest <= parts.len()),
                "{count} repetitions: {parts:?}"
            );
        }
    }
}
