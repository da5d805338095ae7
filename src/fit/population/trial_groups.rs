//! Whether the trials of a session fall into two groups, as those of two persons do.

use nalgebra::{DMatrix, DVector};

use super::hierarchy::{Hierarchy, TrialSummary};
use crate::fit::linalg::cholesky;

/// Standard deviation by which a person's parameters vary from trial to trial, as logarithm: the prior's of the spreads.
const TRIAL_SD: f64 = 0.03;

/// The smaller group has at least this many trials: fewer are outliers.
const LEAST_GROUP: f64 = 3.0;

/// Two groups are distinct above this statistic. At most 1 % of one person's sessions are (docs/benchmarks/session-model.md).
const LEAST_STATISTIC: f64 = 12.0;

const MAX_GROUP_ITERATIONS: usize = 40;

/// Two groups of trials.
#[derive(Debug, Clone)]
pub struct TrialGroups {
    /// Twice the logarithm of the likelihood ratio of two groups to one.
    pub statistic: f64,
    /// Places of the trials of the smaller group.
    pub smaller: Vec<usize>,
    /// By how much the logarithms of the parameters of the second group are above those of the first.
    pub difference: DVector<f64>,
    /// Standard errors of `difference`.
    errors: DVector<f64>,
}

/// What a trial says of a shift of all parameters from the mean of its condition: log likelihood h'd - d'Pd/2, where the trial varies
/// by [`TRIAL_SD`] about the shifted mean.
struct Shift {
    h: DVector<f64>,
    p: DMatrix<f64>,
}

impl Shift {
    fn log_likelihood(&self, by: &DVector<f64>) -> f64 {
        self.h.dot(by) - 0.5 * by.dot(&(&self.p * by))
    }
}

impl TrialGroups {
    /// Whether one group does not explain the trials.
    pub fn are_distinct(&self) -> bool {
        self.statistic > LEAST_STATISTIC
    }

    /// Coordinate of the parameter that differs most beside its error, and the part by which it does.
    pub fn largest_difference(&self) -> (usize, f64) {
        let place = self.difference.component_div(&self.errors).icamax();
        (place, libm::expm1(self.difference[place].abs()))
    }

    /// The best division of the trials into two groups that differ in all conditions alike; `None` where there is none.
    pub(super) fn of(hierarchy: &Hierarchy, trials: &[TrialSummary]) -> Option<Self> {
        let shifts: Vec<Shift> = trials
            .iter()
            .map(|trial| {
                let optimum = &trial.optima[0];
                let size = optimum.at.len();
                let mean = &hierarchy.condition_means[trial.condition];
                let prior = DMatrix::from_diagonal_element(size, size, 1.0 / (TRIAL_SD * TRIAL_SD));
                let shrinkage = &prior * cholesky(&optimum.information + &prior)?.inverse();
                let h = &shrinkage * (optimum.information_vector() - &optimum.information * mean);
                Some(Shift { h, p: &prior - &shrinkage * &prior })
            })
            .collect::<Option<_>>()?;
        let one = best_shift(&shifts, |_| 1.0)?;
        let alone: f64 = shifts.iter().map(|shift| shift.log_likelihood(&one)).sum();
        let size = one.len();
        // Groups to begin with: above and below the mean in a parameter.
        let found = (0..size).filter_map(|own| {
            mixture(&shifts, shifts.iter().map(|shift| if shift.h[own] > 0.0 { 0.9 } else { 0.1 }).collect())
        });
        let (log_likelihood, second, [a, b]) = found.max_by(|x, y| x.0.total_cmp(&y.0))?;
        let (in_second, in_first): (Vec<usize>, Vec<usize>) =
            (0..second.len()).partition(|trial| second[*trial] > 0.5);
        let error = |place: usize| {
            let information = |own: &dyn Fn(usize) -> f64| -> f64 {
                shifts.iter().enumerate().map(|(trial, shift)| own(trial) * shift.p[(place, place)]).sum()
            };
            libm::sqrt(
                1.0 / information(&|trial| second[trial]) + 1.0 / information(&|trial| 1.0 - second[trial]),
            )
        };
        Some(Self {
            errors: DVector::from_iterator(size, (0..size).map(error)),
            statistic: 2.0 * (log_likelihood - alone),
            smaller: if in_second.len() < in_first.len() { in_second } else { in_first },
            difference: b - a,
        })
    }
}

/// The shift of largest likelihood of trials with these weights.
fn best_shift(shifts: &[Shift], weight: impl Fn(usize) -> f64) -> Option<DVector<f64>> {
    let size = shifts.first()?.h.len();
    let (mut h, mut p) = (DVector::zeros(size), DMatrix::from_diagonal_element(size, size, 1e-6));
    for (trial, shift) in shifts.iter().enumerate() {
        h += &shift.h * weight(trial);
        p += &shift.p * weight(trial);
    }
    Some(cholesky(p)?.solve(&h))
}

/// Log likelihood, probability of the second group for each trial, and the shifts of both, by expectation maximisation from `second`.
fn mixture(shifts: &[Shift], mut second: Vec<f64>) -> Option<(f64, Vec<f64>, [DVector<f64>; 2])> {
    let count = shifts.len() as f64;
    let mut best = None;
    for _ in 0..MAX_GROUP_ITERATIONS {
        let sum: f64 = second.iter().sum();
        if sum < LEAST_GROUP || count - sum < LEAST_GROUP {
            return None;
        }
        let part = sum / count;
        let a = best_shift(shifts, |trial| 1.0 - second[trial])?;
        let b = best_shift(shifts, |trial| second[trial])?;
        let mut log_likelihood = 0.0;
        for (shift, own) in shifts.iter().zip(&mut second) {
            let first = libm::log(1.0 - part) + shift.log_likelihood(&a);
            let other = libm::log(part) + shift.log_likelihood(&b);
            let most = first.max(other);
            let both = most + libm::log(libm::exp(first - most) + libm::exp(other - most));
            *own = libm::exp(other - both);
            log_likelihood += both;
        }
        best = Some((log_likelihood, [a, b]));
    }
    best.map(|(log_likelihood, centres)| (log_likelihood, second, centres))
}
