//! Low-pass filter of the feedback: the torque and EMG that the subject sees.

use std::f64::consts::TAU;

use crate::rig::Sample;

/// Time constant of the EMG bars, s: steady enough to read, fast enough for feedback.
const EMG_TIME_CONSTANT_S: f64 = 0.1;

/// First-order low-pass filters of torque and rectified EMG, with their present values.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FeedbackFilter {
    torque_share: f64,
    emg_share: f64,
    /// Torque, offset included, N m.
    pub torque_nm: f64,
    /// Rectified EMG of the flexor, fraction of MVC; `None` where it is not measured.
    pub fcr_mvc: Option<f64>,
    /// Rectified EMG of the extensor, fraction of MVC; `None` where it is not measured.
    pub ecr_mvc: Option<f64>,
    started: bool,
}

impl FeedbackFilter {
    /// Filters whose torque has the cut-off frequency `cutoff_hz`.
    pub fn new(cutoff_hz: f64, sample_rate_hz: f64) -> Self {
        let share = |time_constant_s: f64| 1.0 - libm::exp(-1.0 / (time_constant_s * sample_rate_hz));
        Self {
            torque_share: share(1.0 / (TAU * cutoff_hz)),
            emg_share: share(EMG_TIME_CONSTANT_S),
            torque_nm: 0.0,
            fcr_mvc: None,
            ecr_mvc: None,
            started: false,
        }
    }

    /// Restarts the filters at the next sample: at the start of a record, whose samples alone must determine its outcome, and
    /// after the rig was disarmed.
    pub fn restart(&mut self) {
        self.started = false;
    }

    /// Goes on with EMG in another unit: the values of FCR and ECR so far are divided by `factors`.
    pub fn rescale_emg(&mut self, factors: [f64; 2]) {
        self.fcr_mvc = self.fcr_mvc.map(|emg| emg / factors[0]);
        self.ecr_mvc = self.ecr_mvc.map(|emg| emg / factors[1]);
    }

    /// Filters one sample.
    pub fn update(&mut self, sample: &Sample) {
        if !self.started {
            self.started = true;
            (self.torque_nm, self.fcr_mvc, self.ecr_mvc) = (sample.torque_l_nm, None, None);
        }
        self.torque_nm += self.torque_share * (sample.torque_l_nm - self.torque_nm);
        for (level, measured) in
            [(&mut self.fcr_mvc, sample.emg_fcr_mvc), (&mut self.ecr_mvc, sample.emg_ecr_mvc)]
        {
            let before = level.unwrap_or(0.0);
            *level = measured.map(|emg| before + self.emg_share * (emg.abs() - before));
        }
    }
}
