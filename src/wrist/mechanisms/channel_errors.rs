//! Errors of the recorded angle and of its timing against the torque.

use super::spline::{SPLINE_PARAMETERS, Spline};
use crate::number::Number;
use crate::wrist::mechanics::Kinematics;

/// How the recorded angle differs from the motor's angle.
#[derive(Debug, Clone, Copy)]
pub struct ChannelErrors<T> {
    /// Lag of the torque record behind the angle record, s.
    pub torque_delay_s: T,
    /// Recorded angle over true angle.
    pub angle_gain: T,
    /// Parameters of the spline h of a channel that is not linear: the true angle is r + h(r) - h(0) at the recorded angle r,
    /// from which the gain is removed. `None`: it is linear.
    pub angle_law: Option<[T; SPLINE_PARAMETERS]>,
    /// Bandwidth with which the motor follows the record, Hz, if the record is the command. `None`: the record is the motor's angle.
    pub following_hz: Option<T>,
}

impl<T: Number> ChannelErrors<T> {
    /// No error: the record is the motor's angle, at the time of the torque.
    #[inline(always)]
    pub fn none() -> Self {
        Self {
            torque_delay_s: T::constant(0.0),
            angle_gain: T::constant(1.0),
            angle_law: None,
            following_hz: None,
        }
    }

    /// The true angle and speed, from recorded ones without gain.
    #[inline(always)]
    pub fn straightened(&self, recorded: Kinematics<T>) -> Kinematics<T> {
        let Some(law) = &self.angle_law else { return recorded };
        let law = Spline::new(law);
        Kinematics {
            theta: recorded.theta + law.change(recorded.theta, T::constant(0.0)),
            omega: recorded.omega + recorded.omega * law.slope_at(recorded.theta),
        }
    }
}

impl ChannelErrors<f64> {
    /// The angle that the channel records, at this true angle, rad.
    pub fn recorded_angle_rad(&self, true_rad: f64) -> f64 {
        let Some(law) = &self.angle_law else { return self.angle_gain * true_rad };
        let law = Spline::new(law);
        let mut recorded = true_rad;
        // Newton's method; a law that can be inverted is close to a straight line.
        for _ in 0..20 {
            let error = recorded + law.change(recorded, 0.0) - true_rad;
            recorded -= error / (1.0 + law.slope_at(recorded));
        }
        self.angle_gain * recorded
    }
}
