//! Why rig trials cannot be analysed.

use super::rig_contradiction::RigContradiction;

/// Why a calibration cannot be made of a session's rig trials.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum CalibrateError {
    /// No trial in which the motor moves.
    #[error(
        "rig-trials.csv: no trial of status ok in which the motor moves; expected at least one with a ramp or a multisine"
    )]
    NoMotion,
    /// No empty handle to compare.
    #[error(
        "rig-trials.csv: no trial of status ok with the empty handle in motion; expected some, which are compared with the \
         calibration"
    )]
    NoEmptyHandle,
    /// A torque that never changes at rest.
    #[error(
        "rig-trials: the torque has no noise at all in the rests before the motions; expected the raw signal of the sensor. Is it \
         connected?"
    )]
    NoNoise,
    /// A record that does not end where it began.
    #[error(
        "{file}: the motor ends {end_rad:.4} rad from where it started; expected a record that ends with the return to the start \
         position"
    )]
    NoReturn {
        /// The record.
        file: String,
        /// Angle at its end, beside the start, rad.
        end_rad: f64,
    },
    /// Records against their table.
    #[error(
        "the rig trials contradict what rig-trials.csv and session.json state{}\nNothing was fitted. Correct the files, or give trials that \
         went wrong another status than ok",
        .0.iter().map(|one| format!("\n  {one}")).collect::<String>()
    )]
    Contradicts(Vec<RigContradiction>),
    /// A matrix that is no covariance: its numbers are not finite, or a combination of them has a variance below zero.
    #[error(
        "rig-trials: {0} cannot be computed: it is not finite, or a combination of its parts has a variance of zero or less. Nothing was \
         fitted. Are the units of the records, and the loads in rig-trials.csv, right?"
    )]
    NoCovariance(&'static str),
    /// A calibration whose covariance has no inverse.
    #[error(
        "{0}: the covariance of the calibration has no inverse, so that nothing can be compared with it: a quantity, or a combination of \
         several, has no error at all. Calibrate anew"
    )]
    SingularCalibration(String),
    /// A calibration in which nothing is known.
    #[error(
        "{0}: no quantity has a value, so there is nothing to compare with; calibrate with known loads first"
    )]
    NothingCalibrated(String),
}
