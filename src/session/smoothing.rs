//! What the person sees: torque and muscle activity, smoothed.

use std::f64::consts::TAU;

use crate::rig::Sample;

/// Time constant of the EMG bars, s: steady to the eye, and still quick enough for feedback.
const EMG_TIME_CONSTANT_S: f64 = 0.1;

/// The smoothed signals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedbackFilter {
    torque_share: f64,
    emg_share: f64,
    /// Torque, offset included, N m.
    pub torque_nm: f64,
    /// Rectified EMG of the flexor, fraction of MVC.
    pub fcr_mvc: f64,
    /// Rectified EMG of the extensor, fraction of MVC.
    pub ecr_mvc: f64,
    started: bool,
}

impl FeedbackFilter {
    /// Smooths torque below `cutoff_hz`.
    pub fn new(cutoff_hz: f64, sample_rate_hz: f64) -> Self {
        let share = |time_constant_s: f64| 1.0 - libm::exp(-1.0 / (time_constant_s * sample_rate_hz));
        Self {
            torque_share: share(1.0 / (TAU * cutoff_hz)),
            emg_share: share(EMG_TIME_CONSTANT_S),
            torque_nm: 0.0,
            fcr_mvc: 0.0,
            ecr_mvc: 0.0,
            started: false,
        }
    }

    /// A record begins, which must tell all that its outcome depends on; or the units of EMG have changed, or the rig
    /// was disarmed in between: begins anew.
    pub fn restart(&mut self) {
        self.started = false;
    }

    /// Takes a sample in.
    pub fn update(&mut self, sample: &Sample) {
        if !self.started {
            self.started = true;
            (self.torque_nm, self.fcr_mvc, self.ecr_mvc) = (sample.torque_l_nm, 0.0, 0.0);
        }
        self.torque_nm += self.torque_share * (sample.torque_l_nm - self.torque_nm);
        self.fcr_mvc += self.emg_share * (sample.emg_fcr_mvc.abs() - self.fcr_mvc);
        self.ecr_mvc += self.emg_share * (sample.emg_ecr_mvc.abs() - self.ecr_mvc);
    }
}
