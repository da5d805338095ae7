//! Averaging of the motor angle over the trials of one velocity, which reduces the quantisation error of the encoder.
//!
//! Behind the paper's filter, a single record with little smoothing is accurate enough. A diagnosis uses a band of some hundred
//! hertz, in which the steps of an encoder would weigh as much as the noise of the torque; a mechanism that smooths the angle (lag
//! of the servo, too much damping of the lever) would then seem to improve the model.

use super::chosen_smoothing::{AngleRecords, smoothing};
use super::observations::{Observations, TrialObservation, mean_signal};
use crate::statistics::group_indices;
use crate::wrist::{Kinematics, Smoothing};

/// Trials whose motor moves alike.
pub(super) struct AlikeTrials {
    /// Their places among the observations.
    pub trials: Vec<usize>,
    /// The condition of each.
    pub conditions: Vec<usize>,
    /// Sample of the onset in `angles`.
    pub onset: usize,
    /// Their angles, aligned at the onset, rad.
    pub angles: Vec<Vec<f64>>,
    /// The recorded loads of their motors at the same samples, N m.
    pub loads: Vec<Vec<f64>>,
    /// Mean of the angles.
    pub mean: Vec<f64>,
}

impl AlikeTrials {
    fn of(observations: &Observations, trials: Vec<usize>) -> Self {
        let own = || trials.iter().map(|trial| &observations.trials[*trial]);
        let onset = own().map(|trial| trial.input.onset).min().unwrap_or(0);
        let after = own().map(|trial| trial.angle_rad.len() - trial.input.onset).min().unwrap_or(0);
        let aligned = |trial: &TrialObservation, signal: &[f64]| {
            signal[trial.input.onset - onset..trial.input.onset + after].to_vec()
        };
        let angles: Vec<Vec<f64>> = own().map(|trial| aligned(trial, &trial.angle_rad)).collect();
        let loads = own().map(|trial| aligned(trial, &trial.load_nm)).collect();
        let conditions = own().map(|trial| trial.condition).collect();
        let mean = mean_signal(&angles);
        Self { trials, conditions, onset, angles, loads, mean }
    }

    /// What each angle has beside the mean.
    pub(super) fn differences(&self) -> Vec<Vec<f64>> {
        let own = |angle: &Vec<f64>| angle.iter().zip(&self.mean).map(|(own, mean)| own - mean).collect();
        self.angles.iter().map(own).collect()
    }
}

impl Observations {
    /// Replaces the motion of each trial by the mean over the trials of its velocity plus the trial's own difference, each smoothed as far
    /// as the errors of the angle ask for.
    pub fn average_motion(&mut self) {
        let groups = self.alike_trials();
        let trials = self.trials.len() as f64;
        let variance = if self.angle_step_rad > 0.0 {
            self.angle_step_rad * self.angle_step_rad / 12.0
        } else {
            self.angle_noise_rad * self.angle_noise_rad
        };
        let of_mean = groups.len() as f64 / trials;
        let chosen = |records: &dyn Fn(&AlikeTrials) -> Vec<Vec<f64>>, share: f64| {
            let records = groups.iter().map(|group| AngleRecords {
                angle_rad: records(group),
                onset: group.onset,
                variance_rad2: share * variance,
            });
            let records: Vec<AngleRecords> = records.collect();
            smoothing(&records, self.samples, &self.sections, self.period_s)
        };
        let mean = chosen(&|group| vec![group.mean.clone()], of_mean);
        let difference = chosen(&AlikeTrials::differences, 1.0 - of_mean);
        self.angle_smoothings = vec![(of_mean, mean), (1.0 - of_mean, difference)];
        self.average(&groups, mean, difference);
    }

    /// The same session with its motion smoothed once more, as if the smoothed motion had been recorded without an error: what that changes
    /// is what the smoothing has changed already, to first order.
    pub fn smoothed_again(&self) -> Self {
        let mut smoothed = self.clone();
        // The motion is as late as the torque already, and without the friction.
        smoothed.constants.torque_delay_s = 0.0;
        smoothed.constants.bearing_friction_nm = 0.0;
        let taken: Vec<_> = smoothed.trials.iter_mut().map(|trial| trial.friction.take()).collect();
        for trial in &mut smoothed.trials {
            trial.angle_rad = trial.input.motion.iter().map(|knot| knot.theta).collect();
            trial.input.motion = Smoothing::ONE_RECORD.motion(&trial.angle_rad, self.period_s);
        }
        if let [(_, mean), (_, difference)] = self.angle_smoothings[..] {
            let groups = smoothed.alike_trials();
            smoothed.average(&groups, mean, difference);
        }
        smoothed.trials.iter_mut().zip(taken).for_each(|(trial, taken)| trial.friction = taken);
        smoothed.constants = self.constants;
        smoothed
    }

    /// The trials whose motor moves alike: those of each velocity and label.
    pub fn trials_of_velocities(&self) -> Vec<Vec<usize>> {
        let key =
            |trial: usize| (self.trials[trial].velocity_rad_s.to_bits(), self.trials[trial].label.clone());
        group_indices(self.trials.len(), key).into_values().collect()
    }

    pub(super) fn alike_trials(&self) -> Vec<AlikeTrials> {
        self.trials_of_velocities().into_iter().map(|trials| AlikeTrials::of(self, trials)).collect()
    }

    /// Averages the motion over the trials of each group.
    fn average(&mut self, groups: &[AlikeTrials], mean: Smoothing, difference: Smoothing) {
        for group in groups {
            let common = mean.motion(&group.mean, self.period_s);
            let records = group.angles.iter().zip(&group.loads);
            for ((trial, (angle, load)), own) in group.trials.iter().zip(records).zip(group.differences()) {
                let own = difference.motion(&own, self.period_s);
                let sum = |(a, b): (&Kinematics<f64>, &Kinematics<f64>)| Kinematics {
                    theta: a.theta + b.theta,
                    omega: a.omega + b.omega,
                };
                let motion = self.as_torque_sees(common.iter().zip(&own).map(sum).collect());
                let mut averaged = self.trials[*trial].clone();
                averaged.input.motion = motion;
                averaged.input.onset = group.onset;
                averaged.angle_rad.clone_from(angle);
                averaged.load_nm.clone_from(load);
                self.take_friction(&mut averaged);
                self.trials[*trial] = averaged;
            }
        }
    }
}
