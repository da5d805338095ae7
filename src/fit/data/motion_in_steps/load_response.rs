//! How far the load turns the motor away from the mean motion of its velocity: no servo is infinitely stiff, and the trials of a velocity
//! have other torques.
//!
//! The records of all trials together say how the servo answers its load: by a sum of low-passes, whose compliances are fitted by least
//! squares. That is known far better than an encoder's step, and little is left of a trial's own motion.
//!
//! The load of a trial is the mean over the repetitions of its condition, smoothed, and what its own stiffness adds, in proportion to the
//! mean angle. The noise of its own record would come back in the torque that is predicted from the motion, and add up with itself: a stiff
//! lever makes as much torque of the answer as the load had.

use nalgebra::{DMatrix, DVector};

use crate::fit::data::input_averaging::AlikeTrials;
use crate::fit::data::observations::mean_signal;
use crate::signal::{Section, filter};
use crate::wrist::Smoothing;

/// Cut-off frequencies of the low-passes, Hz: those of a slow and of a fast servo, and one between. A servo that brings the load back is a
/// difference of two.
const CUTOFFS_HZ: [f64; 3] = [15.0, 50.0, 150.0];

/// Part of the largest singular value below which a combination of the low-passes is left out: it moves no record.
const SMALLEST_SINGULAR_VALUE: f64 = 1e-9;

/// The widest of what records of an angle are smoothed by: what loads differ by rises over a whole ramp.
const SMOOTHING: Smoothing = Smoothing { half_s: 0.008, twice: true };

/// A signal of each trial of a velocity, on the same samples.
type TrialSignals = Vec<Vec<f64>>;

/// How the motor answers its load.
pub struct LoadResponse {
    period_s: f64,
    /// Of each low-pass, rad/(N m).
    compliances: [f64; CUTOFFS_HZ.len()],
    /// Their covariance from the rounding of the records.
    covariance: DMatrix<f64>,
}

impl LoadResponse {
    /// As the trials of all `groups` show it in records with steps of `step_rad`; no answer where their loads do not differ.
    pub fn of(groups: &[AlikeTrials], step_rad: f64, period_s: f64) -> Self {
        let loads: Vec<TrialSignals> = groups.iter().map(|group| loads(group, period_s)).collect();
        let column = |which: &usize| {
            let pass = |load: &Vec<f64>| passed(*which, load, period_s);
            without_levels(loads.iter().map(|own| own.iter().map(pass).collect()))
        };
        let columns: Vec<DVector<f64>> = (0..CUTOFFS_HZ.len()).map(|which| column(&which)).collect();
        let design = DMatrix::from_columns(&columns);
        let records = without_levels(groups.iter().map(|group| beside_the_mean(group.angles.clone())));
        let squares = (design.transpose() * &design).svd(true, true);
        let smallest = SMALLEST_SINGULAR_VALUE * squares.singular_values.max();
        let inverse = squares.pseudo_inverse(smallest);
        let inverse = inverse.unwrap_or_else(|_| DMatrix::zeros(CUTOFFS_HZ.len(), CUTOFFS_HZ.len()));
        let mut compliances = [0.0; CUTOFFS_HZ.len()];
        compliances.copy_from_slice((&inverse * design.transpose() * records).as_slice());
        tracing::debug!(?compliances, "answer of the motor to its load, rad/(N m)");
        Self { period_s, compliances, covariance: inverse * (step_rad * step_rad / 12.0) }
    }

    /// How far its load turns the motor of each trial of a group, beside their mean, rad.
    pub fn motions(&self, group: &AlikeTrials) -> TrialSignals {
        loads(group, self.period_s).iter().map(|load| self.answer(load)).collect()
    }

    /// Covariance of the errors of the motions of `group`, mean over the trials, rad^2: from the rounding of the records, and if the torque has
    /// the covariance `unsteadiness`, (N m)^2, at the samples `places` without being a load, and stays as it is after the last of them. Of a
    /// mean over repetitions it is less.
    pub fn errors(&self, group: &AlikeTrials, unsteadiness: &DMatrix<f64>, places: &[usize]) -> DMatrix<f64> {
        let count = group.mean.len();
        let column = |which: usize| {
            let held = places[which]..places.get(which + 1).copied().unwrap_or(count);
            let load: Vec<f64> = (0..count).map(|sample| f64::from(held.contains(&sample))).collect();
            DVector::from_vec(self.answer(&smoothed(&load, self.period_s)))
        };
        let columns: Vec<DVector<f64>> = (0..places.len()).map(column).collect();
        let answers = DMatrix::from_columns(&columns);
        let of_hold = &answers * unsteadiness * answers.transpose();
        let of_rounding = |load: &Vec<f64>| {
            let part = |which| DVector::from_vec(passed(which, load, self.period_s));
            let parts = DMatrix::from_columns(&(0..CUTOFFS_HZ.len()).map(part).collect::<Vec<_>>());
            &parts * &self.covariance * parts.transpose()
        };
        let loads = loads(group, self.period_s);
        let trials = loads.len() as f64;
        loads.iter().map(of_rounding).fold(of_hold, |sum, own| sum + own / trials)
    }

    fn answer(&self, load: &[f64]) -> Vec<f64> {
        let mut sum = vec![0.0; load.len()];
        for (which, compliance) in self.compliances.iter().enumerate() {
            let own = passed(which, load, self.period_s);
            sum.iter_mut().zip(own).for_each(|(to, from)| *to += compliance * from);
        }
        sum
    }
}

fn passed(which: usize, load: &[f64], period_s: f64) -> Vec<f64> {
    filter(&[Section::first_order_low_pass(CUTOFFS_HZ[which], period_s)], load)
}

/// The load of each trial beside their mean, N m.
fn loads(group: &AlikeTrials, period_s: f64) -> TrialSignals {
    let of_conditions = beside_the_mean(means_of_conditions(group));
    let load = |(recorded, of_condition): (&Vec<f64>, &Vec<f64>)| -> Vec<f64> {
        let stiffness = own_stiffness(group, recorded, of_condition);
        let angles = group.mean.iter().map(|angle| stiffness * angle);
        smoothed(of_condition, period_s).iter().zip(angles).map(|(load, own)| load + own).collect()
    };
    beside_the_mean(group.loads.clone()).iter().zip(&of_conditions).map(load).collect()
}

fn smoothed(load: &[f64], period_s: f64) -> Vec<f64> {
    SMOOTHING.motion(load, period_s).iter().map(|knot| knot.theta).collect()
}

/// For each trial, the mean load over the trials of its condition.
fn means_of_conditions(group: &AlikeTrials) -> TrialSignals {
    let mean = |condition: &usize| -> Vec<f64> {
        let alike: Vec<&Vec<f64>> = group
            .conditions
            .iter()
            .zip(&group.loads)
            .filter(|(own, _)| *own == condition)
            .map(|(_, load)| load)
            .collect();
        mean_signal(&alike)
    };
    group.conditions.iter().map(mean).collect()
}

/// By how much a trial is stiffer than its condition, N m/rad: the slope of what it has beside it over the mean angle.
fn own_stiffness(group: &AlikeTrials, recorded: &[f64], of_condition: &[f64]) -> f64 {
    let ramp = || group.mean.iter().enumerate().skip(group.onset);
    let product: f64 = ramp().map(|(sample, angle)| (recorded[sample] - of_condition[sample]) * angle).sum();
    product / ramp().map(|(_, angle)| angle * angle).sum::<f64>().max(f64::MIN_POSITIVE)
}

fn beside_the_mean(mut signals: TrialSignals) -> TrialSignals {
    let mean = mean_signal(&signals);
    for signal in &mut signals {
        signal.iter_mut().zip(&mean).for_each(|(own, mean)| *own -= mean);
    }
    signals
}

/// The signals of all trials below each other, each less its mean over time: where a record rests within a step is no answer to a load.
fn without_levels(velocities: impl Iterator<Item = TrialSignals>) -> DVector<f64> {
    let mut all: Vec<f64> = Vec::new();
    for signal in velocities.flatten() {
        let level = signal.iter().sum::<f64>() / signal.len() as f64;
        all.extend(signal.iter().map(|value| value - level));
    }
    DVector::from_vec(all)
}
