//! Averaging of the motor angle over the trials of one velocity, which reduces the quantisation error of the encoder.
//!
//! Behind the paper's filter, a single record with little smoothing is accurate enough. A diagnosis uses a band of some hundred
//! hertz, in which the steps of an encoder would weigh as much as the noise of the torque; a mechanism that smooths the angle (lag
//! of the servo, too much damping of the lever) would then seem to improve the model.

use super::observations::{Observations, TrialObservation};
use crate::wrist::{Kinematics, Smoothing};

/// Smoothing of the mean angle; it passes the rise of a ramp and the response of a servo.
const MEAN_SMOOTHING: Smoothing = Smoothing { half_s: 0.004, twice: true };

/// Smoothing of the difference between a trial and the mean; a motor yields slowly under another load.
const DIFFERENCE_SMOOTHING: Smoothing = Smoothing { half_s: 0.008, twice: true };

impl Observations {
    /// Replaces the motion of each trial by the mean over the trials of its velocity plus the trial's own slow difference.
    pub fn average_motion(&mut self) {
        let key = |trial: &TrialObservation| (trial.velocity_rad_s.to_bits(), trial.label.clone());
        let mut keys: Vec<_> = self.trials.iter().map(key).collect();
        keys.sort();
        keys.dedup();
        for own in &keys {
            let alike: Vec<usize> =
                (0..self.trials.len()).filter(|t| key(&self.trials[*t]) == *own).collect();
            self.average_over(&alike);
        }
        let of_mean = keys.len() as f64 / self.trials.len() as f64;
        self.angle_smoothings = vec![(of_mean, MEAN_SMOOTHING), (1.0 - of_mean, DIFFERENCE_SMOOTHING)];
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
        if smoothed.angle_smoothings.len() > 1 {
            smoothed.average_motion();
        }
        smoothed.trials.iter_mut().zip(taken).for_each(|(trial, taken)| trial.friction = taken);
        smoothed.constants = self.constants;
        smoothed
    }

    /// Averages the motion over the trials `alike`, aligned at the onset.
    fn average_over(&mut self, alike: &[usize]) {
        let trials = || alike.iter().map(|trial| &self.trials[*trial]);
        let before = trials().map(|trial| trial.input.onset).min().unwrap_or(0);
        let after = trials().map(|trial| trial.angle_rad.len() - trial.input.onset).min().unwrap_or(0);
        let aligned = |trial: &TrialObservation| {
            trial.angle_rad[trial.input.onset - before..trial.input.onset + after].to_vec()
        };
        let angles: Vec<Vec<f64>> = trials().map(aligned).collect();
        let mean: Vec<f64> = (0..before + after)
            .map(|sample| angles.iter().map(|angle| angle[sample]).sum::<f64>() / angles.len() as f64)
            .collect();
        let common = MEAN_SMOOTHING.motion(&mean, self.period_s);
        for (trial, angle) in alike.iter().zip(angles) {
            let difference: Vec<f64> = angle.iter().zip(&mean).map(|(own, mean)| own - mean).collect();
            let own = DIFFERENCE_SMOOTHING.motion(&difference, self.period_s);
            let sum = |(a, b): (&Kinematics<f64>, &Kinematics<f64>)| Kinematics {
                theta: a.theta + b.theta,
                omega: a.omega + b.omega,
            };
            let motion = self.as_torque_sees(common.iter().zip(&own).map(sum).collect());
            let mut averaged = self.trials[*trial].clone();
            averaged.input.motion = motion;
            averaged.input.onset = before;
            averaged.angle_rad = angle;
            self.take_friction(&mut averaged);
            self.trials[*trial] = averaged;
        }
    }
}
