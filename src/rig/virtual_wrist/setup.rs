//! The virtual rig: servo, lever and sensors.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::mechanisms::Mechanisms;
use crate::wrist::Lever;

/// The virtual rig. Values that no source gives are marked as assumed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct Setup {
    /// The lever between motor and handle; `null` for a rigid one. Assumed: 0.0016 kg m2, 0.4 N m s/rad, 900 N m/rad.
    pub lever: Option<Lever>,
    /// Stiffness of the servo, N m/rad; 1000 in section 2.1 of the paper.
    pub servo_stiffness_nm_per_rad: f64,
    /// Natural frequency of the servo without a load, Hz. Assumed: 80.
    pub servo_bandwidth_hz: f64,
    /// Damping ratio of the servo. Assumed: 1.
    pub servo_damping_ratio: f64,
    /// Counts of the encoder in a revolution. Assumed: 2^17.
    pub encoder_counts_per_revolution: f64,
    /// Noise of the strain gauges, N m (standard deviation, white). Assumed: 0.01.
    pub gauge_noise_nm: f64,
    /// What the gauges show at no torque, N m. Assumed: 0.03.
    pub gauge_offset_nm: f64,
    /// One step of the torque's converter, N m. Assumed: 0.0005.
    pub gauge_step_nm: f64,
    /// One step of the EMG's converter, fraction of nominal MVC. Assumed: 0.0001.
    pub emg_step_mvc: f64,
    /// What this rig does beyond Eq. 3-7, from the catalogue of mechanisms.
    pub mechanisms: Mechanisms,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            lever: Some(Lever {
                inertia_kg_m2: 0.0016,
                damping_nm_s_per_rad: 0.4,
                stiffness_nm_per_rad: 900.0,
            }),
            servo_stiffness_nm_per_rad: 1000.0,
            servo_bandwidth_hz: 80.0,
            servo_damping_ratio: 1.0,
            encoder_counts_per_revolution: 131_072.0,
            gauge_noise_nm: 0.01,
            gauge_offset_nm: 0.03,
            gauge_step_nm: 0.0005,
            emg_step_mvc: 0.0001,
            mechanisms: Mechanisms::default(),
        }
    }
}
