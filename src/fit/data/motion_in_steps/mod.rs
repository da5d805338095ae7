//! Motions behind an encoder whose steps are coarse: the recorded angle says between which two angles the motor was, and no more.
//!
//! The trials of one velocity move alike but for what the load of each does to the servo. Both, the mean motion and what is a trial's own,
//! are random functions from rest on, whose third difference is white noise. Given that each sample lies within half a step of its record,
//! their distribution is computed by expectation propagation ([`expectation_propagation`]). Its mean takes the place of the recorded motion,
//! and its covariance that of the errors: rounding errors are no white noise (at a constant speed they are a few spectral lines), and
//! records that are treated as if they were leave errors which look like a low-pass or a delay.

mod expectation_propagation;
mod motion_prior;
mod truncated_normal;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use self::motion_prior::{KnownMotions, RecordsInSteps, most_probable};
use super::input_averaging::AlikeTrials;
use super::motion_errors::MotionErrors;
use super::observations::Observations;
use crate::wrist::{Kinematics, through};

/// Variance, in squares of an encoder step, below which an independent error of a motion is left out: a thousandth of a step moves the
/// torque by less than the smallest noise that is counted.
const SMALLEST_VARIANCE: f64 = 1e-6;

impl Observations {
    /// Replaces the motion of each trial by what its record in steps and those of the trials that move alike say of it. `false` if they
    /// cannot be computed, and nothing is changed.
    pub fn take_motions_in_steps(&mut self) -> bool {
        let groups = self.alike_trials();
        let records = groups.iter().map(|group| {
            let speed_rad_s = self.trials[group.trials[0]].velocity_rad_s.abs();
            RecordsInSteps::new((&group.angles, group.onset), self.angle_step_rad, self.period_s, speed_rad_s)
        });
        let records: Option<Vec<RecordsInSteps>> = records.collect();
        let Some(known) = records.and_then(|records| most_probable(&records)) else { return false };
        let by_level = std::mem::take(&mut self.noise_index);
        let mut noises: Vec<Option<(usize, usize)>> = vec![None; by_level.len()];
        for (velocity, (group, known)) in groups.iter().zip(&known).enumerate() {
            self.take_known(group, known);
            group
                .trials
                .iter()
                .for_each(|trial| noises[*trial] = by_level[*trial].map(|level| (level, velocity)));
        }
        // The errors of a trial's own differ between velocities, and so do the weights of its residuals.
        let mut distinct: Vec<(usize, usize)> = noises.iter().copied().flatten().collect();
        distinct.sort_unstable();
        distinct.dedup();
        let measured = std::mem::take(&mut self.noise_covariances);
        self.noise_covariances = distinct.iter().map(|(level, _)| measured[*level].clone()).collect();
        self.noise_index = noises.iter().map(|own| distinct.binary_search(&(*own)?).ok()).collect();
        true
    }

    /// Gives the trials of a velocity the motions that are known of them.
    fn take_known(&mut self, group: &AlikeTrials, known: &KnownMotions) {
        let (step, period_s) = (self.angle_step_rad, self.period_s);
        let rest = vec![0.0; group.onset - RecordsInSteps::BEFORE_ONSET];
        let motion = |observations: &Self, steps: &DVector<f64>| -> Vec<Kinematics<f64>> {
            let angle: Vec<f64> = rest.iter().chain(steps.iter()).map(|own| own * step).collect();
            observations.as_torque_sees(through(&angle, period_s))
        };
        let own: Vec<_> = directions(&known.own).iter().map(|steps| motion(self, steps)).collect();
        let own = Arc::new(own);
        let shared = directions(&known.mean_covariance);
        for (place, (trial, angle)) in group.trials.iter().zip(&group.angles).enumerate() {
            let mut known_trial = self.trials[*trial].clone();
            known_trial.input.motion = motion(self, &known.motions[place]);
            known_trial.input.onset = group.onset;
            known_trial.angle_rad.clone_from(angle);
            self.take_friction(&mut known_trial);
            let shared = shared.iter().map(|error| motion(self, &(&known.of_mean[place] * error))).collect();
            known_trial.motion_errors = Some(Arc::new(MotionErrors { shared, own: own.clone() }));
            self.trials[*trial] = known_trial;
        }
    }
}

/// Independent errors of unit variance that have this covariance, the largest first.
fn directions(covariance: &DMatrix<f64>) -> Vec<DVector<f64>> {
    let eigen = covariance.clone().symmetric_eigen();
    let mut order: Vec<usize> = (0..eigen.eigenvalues.len()).collect();
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    order
        .into_iter()
        .take_while(|place| eigen.eigenvalues[*place] > SMALLEST_VARIANCE)
        .map(|place| eigen.eigenvectors.column(place) * libm::sqrt(eigen.eigenvalues[place]))
        .collect()
}

#[cfg(test)]
mod tests;
