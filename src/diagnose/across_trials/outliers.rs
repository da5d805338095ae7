//! Trials whose stiffness is not that of their repetitions.

use super::stiffness_table::Stiffnesses;
use crate::statistics::t_two_sided;

/// A trial that does not belong.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the trial.
    pub trial: usize,
    /// Its stiffness over that of its repetitions.
    pub ratio: f64,
}

/// Probability below which a trial does not belong, over all trials. Stricter than a trend's: trials vary with heavier tails than
/// a normal distribution.
const IMPROBABLE: f64 = 0.005;

/// Most outliers that are looked for: one in so many trials.
const MOST: usize = 4;

/// Trials whose stiffness is further from their repetitions than the spread of all others allows, and how probable the most
/// improbable of them is where all trials belong.
///
/// The generalized extreme Studentized deviate (Rosner 1983): the furthest is taken away again and again, and as many are outliers as
/// the last improbable one tells, since two that widen the spread may hide each other.
pub fn outliers(data: &Stiffnesses) -> (Vec<Outlier>, f64) {
    let mut left = data.without(&[]);
    let (mut taken, mut odd, mut least) = (Vec::new(), 0, 1.0_f64);
    while taken.len() * MOST < data.trials.len() {
        let Some((furthest, chance)) = Deviation::furthest(&left) else { break };
        taken.push(furthest);
        least = least.min(chance);
        if chance < IMPROBABLE {
            odd = taken.len();
        }
        left = left.without(&[furthest.trial]);
    }
    taken.truncate(odd);
    (taken, least)
}

/// How far a trial is from the mean of its condition's others, as a logarithm.
struct Deviation {
    place: usize,
    distance: f64,
    /// What it has of the sum of squares about the conditions' means.
    square: f64,
}

impl Deviation {
    fn of(data: &Stiffnesses, place: usize, centred: &[f64]) -> Option<Self> {
        let count = data.repetitions(place).count() as f64;
        let distance = centred[place] * count / (count - 1.0);
        (count > 1.0).then_some(Self { place, distance, square: centred[place] * distance })
    }

    /// The trial that is furthest from its repetitions, and how probable one as far is among so many.
    fn furthest(data: &Stiffnesses) -> Option<(Outlier, f64)> {
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

    /// Twelve conditions of three trials, whose stiffnesses differ by 3 % but for those that are `odd`.
    fn session(seed: u64, odd: &[(usize, f64)]) -> Stiffnesses {
        let mut stream = Stream::new(seed, "stiffnesses");
        let mut logarithms: Vec<f64> = (0..36).map(|_| 3.0 + 0.03 * stream.normal()).collect();
        odd.iter().for_each(|(trial, by)| logarithms[*trial] += by);
        Stiffnesses {
            trials: (0..36).collect(),
            logarithms,
            conditions: (0..36).map(|trial| trial / 3).collect(),
        }
    }

    fn found(data: &Stiffnesses) -> Vec<usize> {
        let mut trials: Vec<usize> = outliers(data).0.iter().map(|own| own.trial).collect();
        trials.sort_unstable();
        trials
    }

    #[test]
    fn two_trials_that_do_not_belong_do_not_hide_each_other() {
        let right =
            (0..100).filter(|seed| found(&session(*seed, &[(7, 0.26), (20, -0.26)])) == [7, 20]).count();
        assert!(right >= 95, "both, and no other, in {right} of 100 sessions");
    }

    #[test]
    fn one_odd_trial_does_not_make_its_repetitions_odd() {
        let right = (0..100).filter(|seed| found(&session(*seed, &[(7, 0.4)])) == [7]).count();
        assert!(right >= 95, "it alone in {right} of 100 sessions");
    }

    #[test]
    fn where_all_trials_belong_one_session_in_a_hundred_at_most_has_an_outlier() {
        let wrong = (0..1000).filter(|seed| !found(&session(*seed, &[])).is_empty()).count();
        assert!(wrong <= 12, "{wrong} of 1000 sessions");
    }
}
