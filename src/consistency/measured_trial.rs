//! What the record of one trial says by itself: where the ramp is, how fast, against which torque.

use crate::dataset::Trial;
use crate::signal;

/// The speed of a ramp is measured over this time, s: longer than the noise of an encoder, shorter than any ramp.
const SPEED_OVER_S: f64 = 0.008;

/// The torque before the ramp is its mean over at most this time, s, the shortest hold that a session may ask for.
const STEADY_S: f64 = 0.4;

/// The work of the ramp is summed over this time after the motion begins, s: the window of the paper.
const WORK_S: f64 = 0.040;

/// Measurements on the record of a trial that do not depend on what the table says.
#[derive(Debug, Clone)]
pub struct MeasuredTrial {
    /// Number of the trial.
    pub number: u32,
    /// Ramp velocity that the table states, rad/s.
    pub stated_speed_rad_s: f64,
    /// Torque that the table states, N m.
    pub stated_torque_nm: f64,
    /// Largest speed of the ramp, with its sign, rad/s.
    pub speed_rad_s: f64,
    /// Largest change of the angle from one sample to the next, without sign, rad.
    pub largest_step_rad: f64,
    /// Mean speed between three and seven tenths of the way, with its sign, rad/s: without rise and overshoot.
    pub middle_speed_rad_s: f64,
    /// Median angle before the ramp, rad.
    pub hold_rad: f64,
    /// Mean torque before the ramp, N m.
    pub hold_nm: f64,
    /// Standard deviation of the torque before the ramp, N m.
    pub unsteadiness_nm: f64,
    /// Work on the wrist from the begin of the motion on, beyond that of the torque before it, J.
    pub work_j: f64,
    /// Angle made good in that time, without sign, rad.
    pub way_rad: f64,
    /// Time of the begin of the motion on the time axis of the record, s.
    pub motion_s: f64,
    /// Time at which the motor was as far as the ramp goes in [`MeasuredTrial::NOTICED_S`] at its speed, s.
    pub noticed_s: f64,
}

impl MeasuredTrial {
    /// A motor counts as moved when it is as far as its ramp goes in this time at full speed, s: a tenth of the window.
    pub const NOTICED_S: f64 = 0.004;

    /// Measures the record of `trial`; `None` if no motion stands out of its noise.
    pub fn new(trial: &Trial, sample_rate_hz: f64) -> Option<Self> {
        let angle = &trial.record.theta_m_rad;
        let torque = &trial.record.torque_l_nm;
        let motion = signal::onset(angle)?;
        let hold_rad = median(&angle[motion / 2..=motion]);
        let far = angle[motion..].iter().map(|x| x - hold_rad).max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let passed = |share: f64| {
            let beyond = angle[motion..].iter().position(|x| (x - hold_rad) / far > share);
            motion + beyond.unwrap_or(0)
        };
        let span = (libm::round(SPEED_OVER_S * sample_rate_hz) as usize).max(2);
        let ramp = passed(0.1).saturating_sub(span)..(passed(0.9) + span).min(angle.len() - 1);
        let speed_rad_s = ramp
            .clone()
            .filter(|sample| sample + span <= ramp.end)
            .map(|sample| (angle[sample + span] - angle[sample]) * sample_rate_hz / span as f64)
            .max_by(|a, b| a.abs().total_cmp(&b.abs()))?;
        let (begin, end) = (passed(0.3), passed(0.7));
        let middle_speed_rad_s = match end - begin {
            0 => speed_rad_s,
            samples => (angle[end] - angle[begin]) * sample_rate_hz / samples as f64,
        };
        let hold = &torque[motion.saturating_sub(libm::round(STEADY_S * sample_rate_hz) as usize)..=motion];
        let hold_nm = mean(hold);
        let squares: f64 = hold.iter().map(|x| (x - hold_nm) * (x - hold_nm)).sum();
        let end = (motion + libm::round(WORK_S * sample_rate_hz) as usize).min(angle.len() - 1);
        let work_j = (motion..end)
            .map(|i| (0.5 * (torque[i] + torque[i + 1]) - hold_nm) * (angle[i + 1] - angle[i]))
            .sum();
        let noticed_rad = Self::NOTICED_S * speed_rad_s.abs();
        let time_s = |sample: usize| trial.record.start_s + sample as f64 / sample_rate_hz;
        // Back from the ramp: where a slow ramp begins is hard to see, and `motion` may be beyond it.
        let rest = angle[..=passed(0.3)].iter().rposition(|x| (x - hold_rad).abs() <= noticed_rad);
        let noticed = rest.map_or(motion, |rest| rest + 1);
        Some(Self {
            number: trial.number,
            stated_speed_rad_s: trial.velocity_rad_s,
            stated_torque_nm: trial.torque_nm,
            speed_rad_s,
            largest_step_rad: angle.windows(2).map(|own| (own[1] - own[0]).abs()).fold(0.0, f64::max),
            middle_speed_rad_s,
            hold_rad,
            hold_nm,
            unsteadiness_nm: libm::sqrt(squares / hold.len() as f64),
            work_j,
            way_rad: (angle[end] - angle[motion]).abs(),
            motion_s: time_s(motion),
            noticed_s: time_s(noticed),
        })
    }

    /// Measured over stated speed of the ramp.
    pub fn speed_ratio(&self) -> f64 {
        self.speed_rad_s / self.stated_speed_rad_s
    }
}

/// Mean of `values`.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Median of `values`, the lower of two; NaN for none.
pub fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len().saturating_sub(1) / 2).copied().unwrap_or(f64::NAN)
}
