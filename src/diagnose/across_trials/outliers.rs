//! Outliers: trials whose stiffness differs from that of their repetitions.

use super::stiffness_table::StiffnessTable;
use crate::statistics::t_two_sided;

/// An outlier trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the trial.
    pub trial: usize,
    /// Ratio of the stiffness to that of the repetitions.
    pub ratio: f64,
}

/// Significance level of the outlier test, over all trials. Strict, since stiffnesses vary with heavier tails than a normal
/// distribution.
const OUTLIER_LEVEL: f64 = 0.005;

/// The outlier test removes at most one of this many trials.
const TRIALS_PER_OUTLIER: usize = 4;

/// The outliers, and the smallest p-value of the test.
///
/// Generalized extreme Studentized deviate test (Rosner 1983): the most extreme trial is removed repeatedly, and all trials up to the
/// last significant one are outliers, since two outliers that widen the spread may mask each other.
pub fn outliers(data: &StiffnessTable) -> (Vec<Outlier>, f64) {
    let mut left = data.without(&[]);
    let (mut taken, mut odd, mut least) = (Vec::new(), 0, 1.0_f64);
    while taken.len() * TRIALS_PER_OUTLIER < data.trials.len() {
        let Some((furthest, chance)) = Deviation::furthest(&left) else { break };
        taken.push(furthest);
        least = least.min(chance);
        if chance < OUTLIER_LEVEL {
            odd = taken.len();
        }
        left = left.without(&[furthest.trial]);
    }
    taken.truncate(odd);
    (taken, least)
}

/// Deviation of a trial from the mean of the other trials of its condition, as a logarithm.
struct Deviation {
    place: usize,
    distance: f64,
    /// Contribution to the sum of squares about the condition means.
    square: f64,
}

impl Deviation {
    fn of(data: &StiffnessTable, place: usize, centred: &[f64]) -> Option<Self> {
        let count = data.repetitions(place).count() as f64;
        let distance = centred[place] * count / (count - 1.0);
        (count > 1.0).then_some(Self { place, distance, square: centred[place] * distance })
    }

    /// The most extreme trial, and its p-value corrected for the number of trials.
    fn furthest(data: &StiffnessTable) -> Option<(Outlier, f64)> {
        let centred = data.centred(&data.logarithms);
        let all = (0..centred.len()).filter_map(|place| Self::of(data, place, &centred));
        let furthest = all.max_by(|a, b| a.square.total_cmp(&b.square))?;
        let freedom = data.freedom() - 1.0;
        let others: f64 = centred.iter().map(|own| own * own).sum::<f64>() - furthest.square;
        if freedom < 1.0 || others <= 0.0 {
            return None;
        }
        let t = libm::sqrt(furthest.square * freedom / others);
        let chance = (centred.len() as f64 * t_two_sided(t, freedom)).min(1.0);
        Some((Outlier { trial: data.trials[furthest.place], ratio: libm::exp(furthest.distance) }, chance))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// Twelve conditions of three trials, with stiffnesses that vary by 3 %; `odd` trials are shifted.
    fn session(seed: u64, odd: &[(usize, f64)]) -> StiffnessTable {
        let mut stream = Stream::new(seed, "stiffnesses");
        let mut logarithms: Vec<f64> = (0..36).map(|_| 3.0 + 0.03 * stream.normal()).collect();
        odd.iter().for_each(|(trial, by)| logarithms[*trial] += by);
        StiffnessTable {
            trials: (0..36).collect(),
            logarithms,
            conditions: (0..36).map(|trial| trial / 3).collect(),
        }
    }

    fn found(data: &StiffnessTable) -> Vec<usize> {
        let mut trials: Vec<usize> = outliers(data).0.iter().map(|own| own.trial).collect();
        trials.sort_unstable();
        trials
    }

    #[test]
    fn two_outliers_do_not_mask_each_other() {
        let right =
            (0..100).filter(|seed| found(&session(*seed, &[(7, 0.26), (20, -0.26)])) == [7, 20]).count();
        assert!(right >= 95, "both, and no other, in {right} of 100 sessions");
    }

    #[test]
    fn one_outlier_does_not_make_its_repetitions_outliers() {
        let right = (0..100).filter(|seed| found(&session(*seed, &[(7, 0.4)])) == [7]).count();
        assert!(right >= 95, "it alone in {right} of 100 sessions");
    }

    #[test]
    fn at_most_one_percent_of_sessions_without_outliers_are_reported_with_one() {
        let wrong = (0..1000).filter(|seed| !found(&session(*seed, &[])).is_empty()).count();
        assert!(wrong <= 12, "{wrong} of 1000 sessions");
    }
}
