//! The limits of angle, torque and speed, compared with every sample.

use super::fault::{Channel, Fault, Quantity};
use super::sample::Sample;
use crate::protocol::Limits;

/// Samples over which the speed is taken: one count of the encoder in a single sample would already look fast.
const SPEED_SAMPLES: usize = 4;

/// What the handle may not exceed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MotionLimits {
    /// Lowest and highest angle from the start position, rad.
    pub angle_rad: [f64; 2],
    /// Highest speed, rad/s.
    pub speed_rad_s: f64,
    /// Highest torque, N m, either sign.
    pub torque_nm: f64,
}

impl From<&Limits> for MotionLimits {
    fn from(limits: &Limits) -> Self {
        Self { angle_rad: limits.angle_rad, speed_rad_s: limits.speed_rad_s, torque_nm: limits.torque_nm }
    }
}

/// A measured quantity that exceeds its limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Exceeded {
    /// Which quantity.
    pub quantity: Quantity,
    /// The measured value, in the unit of the quantity.
    pub measured: f64,
    /// The limit, in the unit of the quantity.
    pub limit: f64,
}

impl From<Exceeded> for Fault {
    fn from(Exceeded { quantity, measured, limit }: Exceeded) -> Self {
        Self::Limit { quantity, measured, limit }
    }
}

/// Compares samples with limits, and derives the speed from the angles.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitMonitor {
    limits: MotionLimits,
    sample_rate_hz: f64,
    angles_rad: [f64; SPEED_SAMPLES],
    samples: u64,
}

impl LimitMonitor {
    /// A monitor before its first sample.
    pub fn new(limits: MotionLimits, sample_rate_hz: f64) -> Self {
        Self { limits, sample_rate_hz, angles_rad: [0.0; SPEED_SAMPLES], samples: 0 }
    }

    /// Forgets the angles so far: after a gap in the samples, the speed is derived anew.
    pub fn restart(&mut self) {
        self.samples = 0;
    }

    /// Checks a whole sample: every channel must be a finite number, and within its limit.
    ///
    /// # Errors
    /// The first channel that is not a number, or the first quantity that exceeds its limit.
    pub fn check_sample(&mut self, sample: &Sample) -> Result<(), Fault> {
        let channels = [
            (Channel::Angle, sample.theta_m_rad),
            (Channel::Torque, sample.torque_l_nm),
            (Channel::EmgFcr, sample.emg_fcr_mvc),
            (Channel::EmgEcr, sample.emg_ecr_mvc),
        ];
        if let Some((channel, _)) = channels.into_iter().find(|(_, value)| !value.is_finite()) {
            return Err(Fault::NotANumber { channel });
        }
        Ok(self.check(sample.theta_m_rad, sample.torque_l_nm)?)
    }

    /// Checks angle, torque, then speed of a sample. An angle that is not a number exceeds its limit.
    ///
    /// # Errors
    /// The first quantity that exceeds its limit.
    pub fn check(&mut self, angle_rad: f64, torque_nm: f64) -> Result<(), Exceeded> {
        let [lowest, highest] = self.limits.angle_rad;
        if !(lowest..=highest).contains(&angle_rad) {
            let limit = if angle_rad < lowest { lowest } else { highest };
            return Err(Exceeded { quantity: Quantity::Angle, measured: angle_rad, limit });
        }
        self.check_torque(torque_nm)?;
        match self.speed(angle_rad) {
            Some(speed_rad_s) if speed_rad_s.abs() > self.limits.speed_rad_s => Err(Exceeded {
                quantity: Quantity::Speed,
                measured: speed_rad_s,
                limit: self.limits.speed_rad_s,
            }),
            _ => Ok(()),
        }
    }

    /// Checks the torque alone, for phases in which angles have no meaning.
    ///
    /// # Errors
    /// The torque, if it exceeds its limit. A torque that is not a number is a fault of the sensor, found elsewhere.
    pub fn check_torque(&self, torque_nm: f64) -> Result<(), Exceeded> {
        if torque_nm.abs() > self.limits.torque_nm {
            let limit = self.limits.torque_nm;
            return Err(Exceeded { quantity: Quantity::Torque, measured: torque_nm, limit });
        }
        Ok(())
    }

    /// The speed over the last samples, rad/s; `None` for the first samples.
    fn speed(&mut self, angle_rad: f64) -> Option<f64> {
        let slot = (self.samples % SPEED_SAMPLES as u64) as usize;
        let before_rad = std::mem::replace(&mut self.angles_rad[slot], angle_rad);
        self.samples += 1;
        let turned_rad = angle_rad - before_rad;
        (self.samples > SPEED_SAMPLES as u64).then(|| turned_rad * self.sample_rate_hz / SPEED_SAMPLES as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: MotionLimits = MotionLimits { angle_rad: [-0.05, 0.2], speed_rad_s: 4.0, torque_nm: 20.0 };

    fn quantity(result: Result<(), Exceeded>) -> Option<(Quantity, f64)> {
        result.err().map(|exceeded| (exceeded.quantity, exceeded.limit))
    }

    #[test]
    fn a_jump_exceeds_the_speed() {
        let mut monitor = LimitMonitor::new(LIMITS, 1e3);
        for _ in 0..10 {
            assert_eq!(monitor.check(0.0, 0.0), Ok(()));
        }
        assert_eq!(quantity(monitor.check(0.1, 0.0)), Some((Quantity::Speed, 4.0)));
    }

    #[test]
    fn the_first_samples_and_those_after_a_gap_have_no_speed() {
        let mut monitor = LimitMonitor::new(LIMITS, 1e3);
        for angle_rad in [0.15, 0.0, 0.15, 0.0] {
            assert_eq!(monitor.check(angle_rad, 0.0), Ok(()));
        }
        monitor.restart();
        assert_eq!(monitor.check(0.2, 0.0), Ok(()));
    }

    #[test]
    fn a_sample_beyond_a_limit_is_found() {
        let check = |angle, torque| quantity(LimitMonitor::new(LIMITS, 1e3).check(angle, torque));
        assert_eq!(check(0.21, 0.0), Some((Quantity::Angle, 0.2)));
        assert_eq!(check(-0.06, 0.0), Some((Quantity::Angle, -0.05)));
        assert_eq!(check(f64::NAN, 0.0), Some((Quantity::Angle, 0.2)));
        assert_eq!(check(0.0, -20.1), Some((Quantity::Torque, 20.0)));
        assert_eq!(check(0.2, 20.0), None);
    }
}
