//! Whether a calibration describes the rig trials that it was made from.

use super::rig_calibration::RigCalibration;

/// Level below which a calibration is said not to describe its trials: one in a hundred sound ones has such a warning.
const DOUBTFUL_MISFIT_P: f64 = 0.01;

/// Whether trials with this probability of their misfit are not described by the calibration.
pub fn is_doubtful_misfit(p_value: f64) -> bool {
    p_value < DOUBTFUL_MISFIT_P
}

impl RigCalibration {
    /// The warning of a calibration whose model does not describe its rig trials.
    pub fn misfit_warning(&self) -> Option<String> {
        let p_value = self.fit.p_value_of_misfit.filter(|p| is_doubtful_misfit(*p))?;
        Some(format!(
            "the model of the rig does not describe its rig trials (p = {p_value:.3}): a constant may be wrong by several of its standard \
             errors. Leave out one load at a time, the clamped handle first (status rejected in rig-trials.csv), and calibrate again: the \
             load without which the trials are described is not what the table states, such as a stop that gives way"
        ))
    }
}
