//! The coordinate of a rig's constant in which its error is normal, and how the file's standard error becomes one of that coordinate.

use super::rig_calibration::RigQuantity;
use crate::statistics::HALF_INTERVAL_95;

/// Time constant of a pole at a frequency, s.
pub fn time_constant_s(frequency_hz: f64) -> f64 {
    1.0 / (std::f64::consts::TAU * frequency_hz)
}

/// Frequency of a pole with a time constant, Hz.
pub fn corner_frequency_hz(time_constant_s: f64) -> f64 {
    1.0 / (std::f64::consts::TAU * time_constant_s)
}

impl RigQuantity {
    /// The coordinate at a value: of a frequency its time constant, of what no rig has at zero its logarithm, else the value.
    pub fn normal_coordinate(self, value: f64) -> f64 {
        match self {
            _ if self.is_frequency() => time_constant_s(value),
            _ if self.is_positive() => libm::log(value),
            _ => value,
        }
    }

    /// Standard error of the coordinate at a value whose `se` is that of the file: 1.96 of them reach the farther end of the interval, which
    /// is the upper one. Negative where the coordinate falls as the value rises.
    pub fn normal_error(self, value: f64, se: f64) -> f64 {
        let end = self.normal_coordinate(value + HALF_INTERVAL_95 * se);
        (end - self.normal_coordinate(value)) / HALF_INTERVAL_95
    }

    /// The value that is `errors` standard errors from `value`, where 1.96 at the most are meant.
    pub fn off_by(self, value: f64, se: f64, errors: f64) -> f64 {
        self.value_at(self.normal_coordinate(value) + errors * self.normal_error(value, se))
    }

    /// The value at a coordinate.
    pub fn value_at(self, coordinate: f64) -> f64 {
        match self {
            _ if self.is_frequency() => corner_frequency_hz(coordinate),
            _ if self.is_positive() => libm::exp(coordinate),
            _ => coordinate,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cut_off_that_is_badly_known_is_off_by_its_time_constant_and_never_negative() {
        // A time constant of 1.5 +- 0.63 ms: its interval ends at 0.27 ms, which is 600 Hz.
        let (cutoff_hz, low_s) = (corner_frequency_hz(1.5e-3), 1.5e-3 - HALF_INTERVAL_95 * 0.63e-3);
        let se = (corner_frequency_hz(low_s) - cutoff_hz) / HALF_INTERVAL_95;
        assert!(se > cutoff_hz, "{se}");
        let of = RigQuantity::TorqueCutoff;
        assert!((of.normal_error(cutoff_hz, se) + 0.63e-3).abs() < 1e-12);
        let [slower, faster] = [-1.0, 1.0].map(|errors| time_constant_s(of.off_by(cutoff_hz, se, errors)));
        assert!((slower - 2.13e-3).abs() < 1e-12 && (faster - 0.87e-3).abs() < 1e-12, "{slower} {faster}");
    }

    #[test]
    fn a_constant_without_error_stays_where_it_is() {
        for (of, value) in
            RigQuantity::ALL.into_iter().zip([0.0016, -0.1, 900.0, 1.1, 0.2, -0.01, 0.9, -1e-3])
        {
            assert!((of.off_by(value, 0.0, 1.0) - value).abs() < 1e-12 * value.abs(), "{of:?}");
        }
    }

    #[test]
    fn a_gain_is_off_by_a_factor_and_an_offset_by_a_torque() {
        let [gain, offset] = [RigQuantity::TorqueGain, RigQuantity::TorqueOffset];
        let product = gain.off_by(1.2, 0.3, 1.0) * gain.off_by(1.2, 0.3, -1.0);
        assert!((product - 1.44).abs() < 1e-12, "{product}");
        assert_eq!(offset.off_by(0.5, 0.25, -1.0), 0.25);
    }
}
