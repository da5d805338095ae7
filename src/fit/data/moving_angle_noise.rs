//! The error of a recorded angle while the motor moves, where a filter before the record hides it in the holds.
//!
//! An encoder of a motor at rest reads one number, and behind a filter its steps cannot be seen. In a ramp the steps are noise: what the
//! second differences of trials of one velocity do not share.

use super::hold_noise::second_differences;
use super::observations::Observations;
use crate::statistics::{SD_BY_MEDIAN, upper_median};

impl Observations {
    /// Standard deviation of a white error of the angle in the ramps, rad, of which the records have what `passed` leaves of one sample; 0 where
    /// no velocity has two trials.
    pub(super) fn moving_angle_noise_rad(&self, passed: &[f64]) -> f64 {
        let mut deviations = Vec::new();
        for group in self.alike_trials() {
            let count = group.angles.len() as f64;
            // The mean has the same error, and takes its part of it.
            let scale = 1.0 / libm::sqrt(1.0 - 1.0 / count);
            for difference in group.differences().iter().filter(|_| count > 1.0) {
                let ramp = &difference[group.onset..(group.onset + self.samples).min(difference.len())];
                deviations.extend(second_differences(ramp).map(|own| scale * own.abs()));
            }
        }
        let of_one = libm::sqrt(second_differences(passed).map(|own| own * own).sum());
        upper_median(deviations).map_or(0.0, |middle| SD_BY_MEDIAN * middle / of_one)
    }
}
