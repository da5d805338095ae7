//! What `fit.json` says of the rig's constants: measured ones, and what an error of assumed ones would do.

use serde::Deserialize;

use crate::dataset::utc_day;

/// What is known of the rig.
#[derive(Debug, Clone, Deserialize)]
pub struct KnownRig {
    /// `rigid`, `assumed`, `measured` or `measured in part`.
    pub lever: String,
    /// The calibration; `None` if the fit had none.
    pub calibration: Option<CalibrationOfFit>,
    /// The error that `assumed` asks about, as a part of the constant.
    pub assumed_error: f64,
    /// What an error of each constant would do that nobody measured.
    pub assumed: Vec<WhatIfConstant>,
}

/// A calibration, as the fit used it.
#[derive(Debug, Clone, Deserialize)]
pub struct CalibrationOfFit {
    /// Name of the session of its rig trials.
    pub session: String,
    /// When its rig trials were measured.
    pub measured_utc: Option<String>,
    /// Probability of residuals this large if the rig's model is right.
    pub p_value_of_misfit: Option<f64>,
    /// Its constants.
    pub quantities: Vec<ConstantOfFit>,
}

/// A constant of a calibration.
#[derive(Debug, Clone, Deserialize)]
pub struct ConstantOfFit {
    /// Its name, with the unit.
    pub name: String,
    /// Its value.
    pub value: Option<f64>,
    /// Its standard error.
    pub se: Option<f64>,
    /// Why there is no value.
    pub reason: Option<String>,
    /// Whether the fit uses it.
    pub used: bool,
}

/// What an error of a constant would do, in per cent: with the constant smaller, and larger.
#[derive(Debug, Clone, Deserialize)]
pub struct WhatIfConstant {
    /// The constant.
    pub constant: String,
    /// The value in the fit.
    pub assumed: f64,
    /// Change of the mean k_srs.
    pub k_srs_percent: [Option<f64>; 2],
    /// Change of the mean x_e.
    pub x_e_percent: [Option<f64>; 2],
}

/// A constant as words with its unit: `lever inertia` and `kg m²`.
pub fn in_words(name: &str) -> (&str, &str) {
    match name {
        "lever_inertia_kg_m2" => ("lever inertia I_l", "kg m²"),
        "lever_damping_nm_s_per_rad" => ("lever damping b_l", "N m s/rad"),
        "lever_stiffness_nm_per_rad" => ("lever stiffness k_l", "N m/rad"),
        "torque_gain" => ("torque gain", ""),
        "torque_offset_nm" => ("torque offset", "N m"),
        "torque_nonlinearity_per_nm2" => ("torque nonlinearity", "1/(N m)²"),
        "angle_gain" => ("angle gain", ""),
        "torque_delay_s" => ("delay of the torque", "s"),
        "torque_cutoff_hz" => ("cut-off of the torque channel", "Hz"),
        "servo_bandwidth_hz" => ("bandwidth of the servo", "Hz"),
        "bearing_friction_nm" => ("friction of the bearing", "N m"),
        other => (other, ""),
    }
}

/// By how many days the calibration was measured before the session; negative if after it. `None` if one of them does not say when.
pub fn days_before(measured_utc: Option<&str>, started_utc: Option<&str>) -> Option<i64> {
    Some(utc_day(started_utc?)? - utc_day(measured_utc?)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn days_between_calibration_and_session_follow_the_calendar() {
        let days = |measured, started| days_before(Some(measured), Some(started));
        assert_eq!(days("2026-11-24T09:00:00Z", "2026-11-24T15:00:00Z"), Some(0));
        assert_eq!(days("2024-02-28T09:00:00Z", "2024-03-01T15:00:00Z"), Some(2));
        assert_eq!(days("2025-12-31T09:00:00Z", "2026-01-01T15:00:00Z"), Some(1));
        assert_eq!(days("2026-11-25T09:00:00Z", "2026-11-24T15:00:00Z"), Some(-1));
        assert_eq!(days_before(None, Some("2026-11-24T15:00:00Z")), None);
        assert_eq!(days("yesterday, early", "2026-11-24T15:00:00Z"), None);
    }
}
