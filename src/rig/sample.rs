//! What a rig measures, and the resolution at which a record keeps it.

/// What was measured at one sample instant.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    /// Motor angle from the start position, rad.
    pub theta_m_rad: f64,
    /// Torque in the lever, offset included, N m.
    pub torque_l_nm: f64,
    /// EMG of the flexor carpi radialis, band-passed and not rectified, fraction of MVC.
    pub emg_fcr_mvc: f64,
    /// EMG of the extensor carpi radialis, the antagonist, fraction of MVC.
    pub emg_ecr_mvc: f64,
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
}

impl Sample {
    /// The sample as a record keeps it.
    pub fn rounded(&self) -> Self {
        let round = |value: f64, steps: f64| (value * steps).round_ties_even() / steps;
        Self {
            theta_m_rad: round(self.theta_m_rad, resolution::ANGLE_PER_RAD),
            torque_l_nm: round(self.torque_l_nm, resolution::TORQUE_PER_NM),
            emg_fcr_mvc: round(self.emg_fcr_mvc, resolution::EMG_PER_MVC),
            emg_ecr_mvc: round(self.emg_ecr_mvc, resolution::EMG_PER_MVC),
        }
    }
}
