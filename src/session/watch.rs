//! The limits, held against every sample in every phase.

use crate::protocol::Limits;
use crate::rig::{Channel, Fault, Quantity, Sample};

/// Over how many samples the speed is taken: one count of the encoder in one sample would already look fast.
const SPEED_SAMPLES: usize = 4;

/// Looks for what must not be.
#[derive(Debug, Clone, PartialEq)]
pub struct Watch {
    limits: Limits,
    sample_rate_hz: f64,
    angles_rad: [f64; SPEED_SAMPLES],
    seen: u64,
}

impl Watch {
    /// Watches over `limits`.
    pub fn new(limits: Limits, sample_rate_hz: f64) -> Self {
        Self { limits, sample_rate_hz, angles_rad: [0.0; SPEED_SAMPLES], seen: 0 }
    }

    /// The rig was disarmed in between: the speed starts anew.
    pub fn restart(&mut self) {
        self.seen = 0;
    }

    /// What is wrong with a sample, if anything is.
    pub fn check(&mut self, sample: &Sample) -> Result<(), Fault> {
        let channels = [
            (Channel::Angle, sample.theta_m_rad),
            (Channel::Torque, sample.torque_l_nm),
            (Channel::EmgFcr, sample.emg_fcr_mvc),
            (Channel::EmgEcr, sample.emg_ecr_mvc),
        ];
        for (channel, value) in channels {
            if !value.is_finite() {
                return Err(Fault::NotANumber { channel });
            }
        }
        let beyond = |quantity, measured, limit| Err(Fault::Limit { quantity, measured, limit });
        let [lowest, highest] = self.limits.angle_rad;
        if sample.theta_m_rad < lowest {
            return beyond(Quantity::Angle, sample.theta_m_rad, lowest);
        }
        if sample.theta_m_rad > highest {
            return beyond(Quantity::Angle, sample.theta_m_rad, highest);
        }
        if sample.torque_l_nm.abs() > self.limits.torque_nm {
            return beyond(Quantity::Torque, sample.torque_l_nm, self.limits.torque_nm);
        }
        if let Some(speed_rad_s) = self.speed(sample.theta_m_rad)
            && speed_rad_s.abs() > self.limits.speed_rad_s
        {
            return beyond(Quantity::Speed, speed_rad_s, self.limits.speed_rad_s);
        }
        Ok(())
    }

    fn speed(&mut self, angle_rad: f64) -> Option<f64> {
        let slot = (self.seen % SPEED_SAMPLES as u64) as usize;
        let before_rad = std::mem::replace(&mut self.angles_rad[slot], angle_rad);
        self.seen += 1;
        let turned_rad = angle_rad - before_rad;
        (self.seen > SPEED_SAMPLES as u64).then(|| turned_rad * self.sample_rate_hz / SPEED_SAMPLES as f64)
    }
}
