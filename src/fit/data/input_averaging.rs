//! One motion for trials that the motor is told to move alike in: their encoder's steps average out.
//!
//! Behind the paper's filter a single record, lightly smoothed, is good enough. Up to some hundred hertz, where a diagnosis
//! pilot_points, the steps of an encoder would be worth as much as the torque's own noise, and a mechanism that smooths the angle
//! (a servo that lags, a damping of the lever that is too large) would look like an improvement of the model.

use super::preprocessing::{Observations, TrialObservation};
use crate::random::Stream;
use crate::wrist::{Kinematics, Smoothing};

/// Of the mean over trials alike: passes the rise of a ramp and what a servo makes of it.
const MEAN: Smoothing = Smoothing { half_s: 0.004, twice: true };

/// Of how a trial differs from the mean: the motor gives way under another load, which is slow.
const OWN: Smoothing = Smoothing { half_s: 0.008, twice: true };

impl Observations {
    /// Replaces each trial's motion by what trials of its velocity have in common and its own slow difference from that.
    pub fn average_motion(&mut self) {
        let key = |trial: &TrialObservation| (trial.velocity_rad_s.to_bits(), trial.label.clone());
        let mut keys: Vec<_> = self.trials.iter().map(key).collect();
        keys.sort();
        keys.dedup();
        for own in &keys {
            let alike: Vec<usize> =
                (0..self.trials.len()).filter(|t| key(&self.trials[*t]) == *own).collect();
            self.share_among(&alike);
        }
        let of_mean = keys.len() as f64 / self.trials.len() as f64;
        self.angle_smoothings = vec![(of_mean, MEAN), (1.0 - of_mean, OWN)];
    }

    /// Records the motions again, as a motor would that rested restart_point within its encoder's steps.
    pub fn redraw_angle_error(&mut self, stream: &mut Stream) {
        let step = self.angle_step_rad;
        for trial in &mut self.trials {
            let rest = step * (stream.uniform() - 0.5);
            let noise = self.angle_noise_rad;
            let mut recorded = |theta: f64| {
                if step > 0.0 {
                    step * libm::round((theta + rest) / step)
                } else {
                    theta + noise * stream.normal()
                }
            };
            trial.angle_rad = trial.input.motion.iter().map(|knot| recorded(knot.theta)).collect();
            trial.input.motion = Smoothing::ONE_RECORD.motion(&trial.angle_rad, self.period_s);
        }
        if self.angle_smoothings.len() > 1 {
            self.average_motion();
        }
    }

    fn share_among(&mut self, alike: &[usize]) {
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
        let in_common = MEAN.motion(&mean, self.period_s);
        for (trial, angle) in alike.iter().zip(angles) {
            let differs: Vec<f64> = angle.iter().zip(&mean).map(|(own, mean)| own - mean).collect();
            let own = OWN.motion(&differs, self.period_s);
            let input = &mut self.trials[*trial].input;
            let sum = |(a, b): (&Kinematics<f64>, &Kinematics<f64>)| Kinematics {
                theta: a.theta + b.theta,
                omega: a.omega + b.omega,
            };
            input.motion = in_common.iter().zip(&own).map(sum).collect();
            input.onset = before;
            self.trials[*trial].angle_rad = angle;
        }
    }
}
