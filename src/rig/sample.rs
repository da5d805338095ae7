//! What a rig measures, and the resolution at which a record keeps it.

use crate::wrist::FurtherChannel;

/// What was measured at one sample instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Motor angle from the start position, rad.
    pub theta_m_rad: f64,
    /// Torque in the lever, offset included, N m.
    pub torque_l_nm: f64,
    /// EMG of the flexor carpi radialis, band-passed and not rectified, fraction of MVC; `None` for a rig that does not measure
    /// it.
    pub emg_fcr_mvc: Option<f64>,
    /// EMG of the extensor carpi radialis, the antagonist, fraction of MVC; `None` for a rig that does not measure it.
    pub emg_ecr_mvc: Option<f64>,
    /// Further channels in the order of [`FurtherChannel::ALL`], each in its unit; `None` for a sensor that the rig does not have.
    pub further: [Option<f64>; FurtherChannel::COUNT],
}

/// How many steps a radian, a newton metre, a second and the MVC are divided into in a record.
///
/// The session is told what the record keeps, no more, so that a replay of the record is told the same.
pub mod resolution {
    /// Angles, 1/rad.
    pub const ANGLE_PER_RAD: f64 = 1e7;
    /// Torques, 1/(N m).
    pub const TORQUE_PER_NM: f64 = 1e5;
    /// EMG, 1/MVC.
    pub const EMG_PER_MVC: f64 = 1e5;

    /// Number of decimal places of a further channel in its unit.
    pub fn further_places(channel: super::FurtherChannel) -> usize {
        match channel {
            super::FurtherChannel::HandleAngle | super::FurtherChannel::JointAngle => 7,
            super::FurtherChannel::HandleAcceleration => 3,
            super::FurtherChannel::HandTorque => 5,
        }
    }

    /// Steps of a further channel, 1 per its unit.
    pub fn further_steps(channel: super::FurtherChannel) -> f64 {
        10f64.powi(further_places(channel) as i32)
    }
}

impl Sample {
    /// The sample as a record keeps it.
    pub fn rounded(&self) -> Self {
        let round = |value: f64, steps: f64| (value * steps).round_ties_even() / steps;
        Self {
            theta_m_rad: round(self.theta_m_rad, resolution::ANGLE_PER_RAD),
            torque_l_nm: round(self.torque_l_nm, resolution::TORQUE_PER_NM),
            emg_fcr_mvc: self.emg_fcr_mvc.map(|emg| round(emg, resolution::EMG_PER_MVC)),
            emg_ecr_mvc: self.emg_ecr_mvc.map(|emg| round(emg, resolution::EMG_PER_MVC)),
            further: std::array::from_fn(|place| {
                self.further[place]
                    .map(|value| round(value, resolution::further_steps(FurtherChannel::ALL[place])))
            }),
        }
    }
}
