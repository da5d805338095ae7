//! Motions behind an encoder whose steps are coarse: the recorded angle says between which two angles the motor was, and no more.
//!
//! The trials of one velocity move alike but for what the load of each does to the servo, which is fitted first ([`load_response`]). Both, the
//! mean motion and what is then left of a trial's own, are random functions from rest on, whose third difference is white noise. Given that each sample lies within half a step of its record,
//! their distribution is computed by expectation propagation ([`expectation_propagation`]). Its mean takes the place of the recorded motion,
//! and its covariance that of the errors: rounding errors are no white noise (at a constant speed they are a few spectral lines), and
//! records that are treated as if they were leave errors which look like a low-pass or a delay.

mod expectation_propagation;
mod load_response;
mod motion_prior;
mod truncated_normal;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use self::load_response::LoadResponse;
use self::motion_prior::{AnswersToLoad, KnownMotions, RecordsInSteps, most_probable};
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
        let by_load = self.answers_to_load(&groups);
        let records = groups.iter().zip(&by_load).map(|(group, by_load)| {
            let speed_rad_s = self.trials[group.trials[0]].velocity_rad_s.abs();
            RecordsInSteps::new(group, by_load, self.angle_step_rad, self.period_s, speed_rad_s)
        });
        let records: Option<Vec<RecordsInSteps>> = records.collect();
        let Some(known) = records.and_then(|records| most_probable(&records)) else { return false };
        let by_level = std::mem::take(&mut self.noise_index);
        let mut noises: Vec<Option<(usize, usize)>> = vec![None; by_level.len()];
        for (velocity, ((group, by_load), known)) in groups.iter().zip(&by_load).zip(&known).enumerate() {
            self.take_known(group, by_load, known);
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

    fn answers_to_load(&self, groups: &[AlikeTrials]) -> Vec<AnswersToLoad> {
        let response = LoadResponse::of(groups, self.angle_step_rad, self.period_s);
        let of_group = |group: &AlikeTrials| {
            let places: Vec<usize> = self.window_noise_samples().map(|sample| group.onset + sample).collect();
            let unsteadiness = self.unsteadiness(&group.trials, places.len());
            AnswersToLoad {
                motions: response.motions(group),
                errors: response.errors(group, &unsteadiness, &places),
            }
        };
        groups.iter().map(of_group).collect()
    }

    /// Covariance of the torque in the hold at `count` noise samples, mean over `trials`, (N m)^2.
    fn unsteadiness(&self, trials: &[usize], count: usize) -> DMatrix<f64> {
        let levels = trials.iter().filter_map(|trial| self.noise_index[*trial]);
        let sum = levels.fold(DMatrix::zeros(count, count), |sum, level| {
            sum + self.noise_covariances[level].covariance.view((0, 0), (count, count))
        });
        sum / trials.len() as f64
    }

    /// Gives the trials of a velocity the motions that are known of them, together with their answers to the load.
    fn take_known(&mut self, group: &AlikeTrials, by_load: &AnswersToLoad, known: &KnownMotions) {
        let (step, period_s) = (self.angle_step_rad, self.period_s);
        let first = group.onset - RecordsInSteps::BEFORE_ONSET;
        let angle = |steps: &DVector<f64>| -> Vec<f64> {
            std::iter::repeat_n(0.0, first).chain(steps.iter().map(|own| own * step)).collect()
        };
        let along = |observations: &Self, angle: &[f64]| -> Vec<Kinematics<f64>> {
            observations.as_torque_sees(through(angle, period_s))
        };
        let motion = |observations: &Self, steps: &DVector<f64>| along(observations, &angle(steps));
        let own: Vec<_> = directions(&known.own).iter().map(|steps| motion(self, steps)).collect();
        let own = Arc::new(own);
        let shared = directions(&known.mean_covariance);
        for (place, (trial, record)) in group.trials.iter().zip(&group.angles).enumerate() {
            let mut known_trial = self.trials[*trial].clone();
            let mut whole = angle(&known.motions[place]);
            let answer = &by_load.motions[place][first..];
            whole[first..].iter_mut().zip(answer).for_each(|(angle, own)| *angle += own - answer[0]);
            known_trial.input.motion = along(self, &whole);
            known_trial.input.onset = group.onset;
            known_trial.angle_rad.clone_from(record);
            known_trial.load_nm.clone_from(&group.loads[place]);
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
