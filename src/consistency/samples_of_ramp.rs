//! The samples that a ramp is judged by, the channels that are fitted, and how finely they are resolved.

use std::ops::Range;

use crate::dataset::Trial;
use crate::signal;

/// Samples count from this time before the onset on, s: what a session must have before a ramp.
const BEFORE_S: f64 = 0.04;

/// Samples count up to this time after the onset, s: the ramps that are used, and what follows at once.
pub(super) const AFTER_S: f64 = 0.1;

/// A channel that every session has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RampChannel {
    /// Angle of the motor.
    Angle,
    /// Torque in the lever.
    Torque,
}

impl RampChannel {
    /// Both.
    pub const ALL: [Self; 2] = [Self::Angle, Self::Torque];

    /// Name of the column.
    pub fn column(self) -> &'static str {
        match self {
            Self::Angle => "theta_m_rad",
            Self::Torque => "torque_l_nm",
        }
    }

    /// Unit of the values.
    pub fn unit(self) -> &'static str {
        match self {
            Self::Angle => "rad",
            Self::Torque => "N m",
        }
    }

    /// Its samples in a trial.
    pub fn of(self, trial: &Trial) -> &[f64] {
        match self {
            Self::Angle => &trial.record.theta_m_rad,
            Self::Torque => &trial.record.torque_l_nm,
        }
    }
}

/// The samples about the ramp of a trial: about the onset that the table states, or else that of the record; `None` without either.
pub fn samples_of_ramp(trial: &Trial, sample_rate_hz: f64) -> Option<Range<usize>> {
    let samples = |time_s: f64| libm::round(time_s * sample_rate_hz) as usize;
    let onset = match trial.onset_s {
        Some(onset_s) => samples((onset_s - trial.record.start_s).max(0.0)),
        None => signal::onset(&trial.record.theta_m_rad)?,
    };
    let end = (onset + samples(AFTER_S)).min(trial.record.theta_m_rad.len());
    let start = onset.saturating_sub(samples(BEFORE_S)).min(end);
    Some(start..end)
}

/// The smallest step of a channel; 0 for one that never moves.
pub fn resolution(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| *step > 0.0);
    let least = steps.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}
