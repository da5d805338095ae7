//! How smooth motions are: random functions from rest on, whose third difference is white noise (a smoothing spline: Wahba 1978), of the size
//! that makes the records most probable.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::expectation_propagation::{Covariances, MotionsWithin};
use crate::fit::data::input_averaging::AlikeTrials;

/// Standard deviation of the place of rest within its step, in steps: anywhere in it, and beyond if that fits better.
const REST_SD: f64 = 1.0;

/// Standard deviation of what an angle has beside its motion, in steps, which also keeps the covariances regular: a record that is said to be
/// one of rounded angles has hardly any other noise.
const JITTER_SD: f64 = 0.001;

/// Time in which the speed of a usual ramp rises, s: third differences are counted by those of such a rise.
const USUAL_RISE_S: f64 = 0.010;

/// Sizes of the third differences as exponents of ten: of the mean motion, and of a trial's own.
type Exponents = [f64; 2];

/// Where the search for them begins: a rise as usual, and servos that give way to their load by half a per cent of it.
const FIRST: Exponents = [0.0, -2.25];

/// Steps of the search; the last is a factor of less than two, within which the evidence hardly differs.
const SEARCH_STEPS: [f64; 2] = [0.75, 0.25];

/// The range of the search: rises that take from a sixth of the usual time to thirty times as long, and motions that hardly differ between
/// trials.
const RANGE: [(f64, f64); 2] = [(-3.0, 1.5), (-6.0, 1.5)];

/// Most samples of a record: the work grows with their third power, to some ten seconds here.
const MOST_SAMPLES: usize = 160;

/// How far the loads of trials that move alike turn their motors, beside the mean of all.
pub struct AnswersToLoad {
    /// Of each trial, rad.
    pub motions: Vec<Vec<f64>>,
    /// Covariance of the errors of each, rad^2.
    pub errors: DMatrix<f64>,
}

/// Records of trials that move alike, in steps from the record at rest.
pub struct RecordsInSteps {
    /// The recorded angle of each trial.
    records: Vec<DVector<f64>>,
    /// Third difference of a usual rise to the speed of these trials, in steps.
    usual_difference: f64,
    /// Covariance of the errors of the answers to the load, in steps.
    load_errors: DMatrix<f64>,
}

/// What is known of motions: each trial's in steps from where it rests.
pub struct KnownMotions {
    /// Mean of each trial's motion.
    pub motions: Vec<DVector<f64>>,
    /// Covariance of the mean motion.
    pub mean_covariance: DMatrix<f64>,
    /// For each trial, the change of its motion by one of the mean motion.
    pub of_mean: Vec<DMatrix<f64>>,
    /// Covariance of a trial's motion if the mean motion were known, mean over the trials.
    pub own: DMatrix<f64>,
}

impl RecordsInSteps {
    /// Number of samples before the onset that are looked at: the first stands for the whole rest, and in the others the motor may already
    /// move.
    pub const BEFORE_ONSET: usize = 3;

    /// Records of `group` in steps of `step_rad`, `period_s` apart, in ramps of `speed_rad_s`, without the answers to the load; `None` if they do
    /// not begin early enough, or are too long.
    pub fn new(
        group: &AlikeTrials,
        by_load: &AnswersToLoad,
        step_rad: f64,
        period_s: f64,
        speed_rad_s: f64,
    ) -> Option<Self> {
        let first = group.onset.checked_sub(Self::BEFORE_ONSET)?;
        let own = |(record, answer): (&Vec<f64>, &Vec<f64>)| {
            let steps =
                record[first..].iter().zip(&answer[first..]).map(|(own, answer)| (own - answer) / step_rad);
            DVector::from_iterator(record.len() - first, steps)
        };
        let records: Vec<DVector<f64>> = group.angles.iter().zip(&by_load.motions).map(own).collect();
        let count = records[0].len();
        let load_errors = by_load.errors.view((first, first), (count, count)) / (step_rad * step_rad);
        let usual_difference =
            speed_rad_s * period_s * period_s * period_s / (USUAL_RISE_S * USUAL_RISE_S * step_rad);
        (count <= MOST_SAMPLES).then_some(Self { records, usual_difference, load_errors })
    }

    fn within(&self, exponents: Exponents) -> Option<MotionsWithin> {
        let count = self.records[0].len();
        let sums = summed_three_times(count);
        let [mean_factor, own] = exponents.map(|own| &sums * (libm::pow(10.0, own) * self.usual_difference));
        let own = &own * own.transpose();
        let jitter = DMatrix::identity(count, count) * (JITTER_SD * JITTER_SD);
        let rest = DMatrix::from_element(count, count, REST_SD * REST_SD);
        let own = own + rest + jitter + &self.load_errors;
        MotionsWithin::new(&Covariances { mean_factor, own }, &self.records)
    }
}

/// The motions behind all `records` at the sizes of greatest evidence; `None` if they cannot be computed.
pub fn most_probable(records: &[RecordsInSteps]) -> Option<Vec<KnownMotions>> {
    let at = |exponents: Exponents| -> Option<Vec<MotionsWithin>> {
        records.par_iter().map(|own| own.within(exponents)).collect()
    };
    let evidence = |found: &[MotionsWithin]| -> f64 { found.iter().map(|own| own.log_evidence).sum() };
    let mut exponents = FIRST;
    let mut best = at(exponents)?;
    for step in SEARCH_STEPS {
        let mut moved = true;
        while moved {
            moved = false;
            for (which, by) in (0..exponents.len()).flat_map(|which| [(which, step), (which, -step)]) {
                let mut other = exponents;
                other[which] = (other[which] + by).clamp(RANGE[which].0, RANGE[which].1);
                let Some(found) = at(other).filter(|found| evidence(found) > evidence(&best)) else {
                    continue;
                };
                (exponents, best, moved) = (other, found, true);
            }
        }
    }
    tracing::debug!(?exponents, log_evidence = evidence(&best), "motions in steps");
    Some(best.into_iter().map(from_rest).collect())
}

/// The same in steps from the place of rest, which nobody knows.
fn from_rest(within: MotionsWithin) -> KnownMotions {
    let count = within.mean_covariance.nrows();
    let mut less_rest = DMatrix::identity(count, count);
    less_rest.column_mut(0).add_scalar_mut(-1.0);
    let trials = within.own.len() as f64;
    let own = within.own.iter().fold(DMatrix::zeros(count, count), |sum, own| sum + own) / trials;
    KnownMotions {
        motions: within.motions.iter().map(|own| &less_rest * own).collect(),
        of_mean: within.of_mean.iter().map(|own| &less_rest * own).collect(),
        own: &less_rest * own * less_rest.transpose(),
        mean_covariance: within.mean_covariance,
    }
}

/// What sums up white noise three times, from the second of `count` samples on.
fn summed_three_times(count: usize) -> DMatrix<f64> {
    DMatrix::from_fn(count, count, |sample, source| {
        if source == 0 || sample < source {
            return 0.0;
        }
        let later = (sample - source) as f64;
        0.5 * (later + 1.0) * (later + 2.0)
    })
}
