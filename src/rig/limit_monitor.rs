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
        if measured.is_finite() {
            return Self::Limit { quantity, measured, limit };
        }
        Self::NotANumber { channel: quantity.channel() }
    }
}

/// Compares samples with limits, and derives the speed from the angles.
#[derive(Debug, Clone, PartialEq)]
pub struct LimitMonitor {
    limits: MotionLimits,
    sample_rate_hz: f64,
    /// The latest angles, each with the number of its sample.
    angles: [(u64, f64); SPEED_SAMPLES],
    /// Angles since the monitor began.
    seen: usize,
    /// Number of the next sample.
    sample: u64,
    /// The latest sample, which a rig gives again when it has no new one.
    last: Option<Sample>,
    /// How often it was given again.
    given_again: usize,
}

impl LimitMonitor {
    /// A monitor before its first sample.
    pub fn new(limits: MotionLimits, sample_rate_hz: f64) -> Self {
        Self {
            limits,
            sample_rate_hz,
            angles: [(0, 0.0); SPEED_SAMPLES],
            seen: 0,
            sample: 0,
            last: None,
            given_again: 0,
        }
    }

    /// Forgets the angles so far: after a gap in the samples, the speed is derived anew.
    pub fn restart(&mut self) {
        self.seen = 0;
        self.last = None;
    }

    /// Passes over samples without readings: the handle goes on meanwhile.
    pub fn skip(&mut self, samples: u64) {
        self.sample += samples;
    }

    /// Checks a whole sample: every measured channel must be a finite number, and within its limit.
    ///
    /// # Errors
    /// The first channel that is not a number, or the first quantity that exceeds its limit.
    pub fn check_sample(&mut self, sample: &Sample) -> Result<(), Fault> {
        let channels = [
            (Channel::Angle, Some(sample.theta_m_rad)),
            (Channel::Torque, Some(sample.torque_l_nm)),
            (Channel::EmgFcr, sample.emg_fcr_mvc),
            (Channel::EmgEcr, sample.emg_ecr_mvc),
        ];
        let is_no_number = |value: Option<f64>| value.is_some_and(|value| !value.is_finite());
        if let Some((channel, _)) = channels.into_iter().find(|(_, value)| is_no_number(*value)) {
            return Err(Fault::NotANumber { channel });
        }
        let is_given_again = self.last.replace(*sample) == Some(*sample);
        self.given_again = if is_given_again { self.given_again + 1 } else { 0 };
        // What the handle did meanwhile is seen with the next one. After some more of them it is at rest.
        if (1..=SPEED_SAMPLES).contains(&self.given_again) {
            self.skip(1);
            return Ok(());
        }
        Ok(self.check(sample.theta_m_rad, sample.torque_l_nm)?)
    }

    /// Checks angle, torque, then speed of a sample. An angle that is not a number exceeds its limit.
    ///
    /// # Errors
    /// The first quantity that exceeds its limit.
    pub fn check(&mut self, angle_rad: f64, torque_nm: f64) -> Result<(), Exceeded> {
        self.check_angle(angle_rad)?;
        self.check_torque(torque_nm)?;
        self.check_speed(angle_rad)
    }

    /// Checks the angle alone. One that is not a number exceeds its limit.
    ///
    /// # Errors
    /// The angle, if it exceeds its limit.
    pub fn check_angle(&self, angle_rad: f64) -> Result<(), Exceeded> {
        let [lowest, highest] = self.limits.angle_rad;
        if (lowest..=highest).contains(&angle_rad) {
            return Ok(());
        }
        let limit = if angle_rad < lowest { lowest } else { highest };
        Err(Exceeded { quantity: Quantity::Angle, measured: angle_rad, limit })
    }

    /// Derives the speed from this angle and those before, and checks it alone.
    ///
    /// # Errors
    /// The speed, if it exceeds its limit.
    pub fn check_speed(&mut self, angle_rad: f64) -> Result<(), Exceeded> {
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
        let slot = self.seen % SPEED_SAMPLES;
        let (before, before_rad) = std::mem::replace(&mut self.angles[slot], (self.sample, angle_rad));
        let periods = (self.sample - before) as f64;
        self.seen += 1;
        self.sample += 1;
        let turned_rad = angle_rad - before_rad;
        (self.seen > SPEED_SAMPLES).then(|| turned_rad * self.sample_rate_hz / periods)
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
    fn a_sample_that_is_given_again_is_not_taken_for_a_standstill() {
        let mut monitor = LimitMonitor::new(LIMITS, 1e3);
        // 3.5 rad/s, and every fifth sample is lost.
        for number in 0..40 {
            let given = if number % 5 == 4 { number - 1 } else { number };
            let sample = Sample { theta_m_rad: f64::from(given) * 3.5e-3, ..Sample::default() };
            assert_eq!(monitor.check_sample(&sample), Ok(()), "sample {number}");
        }
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
