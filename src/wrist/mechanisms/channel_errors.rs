//! Errors of the recorded angle and of its timing against the torque.

use crate::number::Number;

/// How the recorded angle differs from the motor's angle.
#[derive(Debug, Clone, Copy)]
pub struct ChannelErrors<T> {
    /// Lag of the torque record behind the angle record, s.
    pub torque_delay_s: T,
    /// Recorded angle over true angle.
    pub angle_gain: T,
    /// Bandwidth with which the motor follows the record, Hz, if the record is the command. `None`: the record is the motor's angle.
    pub following_hz: Option<T>,
}

impl<T: Number> ChannelErrors<T> {
    /// No error: the record is the motor's angle, at the time of the torque.
    #[inline(always)]
    pub fn none() -> Self {
        Self { torque_delay_s: T::constant(0.0), angle_gain: T::constant(1.0), following_hz: None }
    }
}
