//! A calibration beyond the torques at which it was measured.

use super::rig_calibration::{RigCalibration, RigQuantity};
use crate::statistics::HALF_INTERVAL_95;

/// Cubic part of the recorded torque at the largest torque, as a part of it, that no sensor exceeds.
pub const LARGEST_NONLINEARITY: f64 = 0.1;

impl RigCalibration {
    /// What is known of the rig in a session with torques of up to `largest_nm`, N m.
    ///
    /// A nonlinearity that small weights leave open may be anything far beyond them. Where its interval is wider at the largest torque than
    /// what sensors can have, it is 0 within that ([`LARGEST_NONLINEARITY`] in 95 %) before the weights are looked at, and all that is known
    /// together with it follows.
    pub fn at_torques_up_to(mut self, largest_nm: f64) -> Self {
        let place = self.covariance_of.iter().position(|own| *own == RigQuantity::TorqueNonlinearity);
        let Some((place, value)) = place.zip(self.value(RigQuantity::TorqueNonlinearity)) else {
            return self;
        };
        let allowed = LARGEST_NONLINEARITY / (largest_nm * largest_nm);
        let with_it: Vec<f64> = self.covariance[place].clone();
        let variance = with_it[place];
        if HALF_INTERVAL_95 * libm::sqrt(variance) <= allowed {
            return self;
        }
        let sd = allowed / HALF_INTERVAL_95;
        let sum = variance + sd * sd;
        for (i, row) in self.covariance.iter_mut().enumerate() {
            for (j, own) in row.iter_mut().enumerate() {
                *own -= with_it[i] * with_it[j] / sum;
            }
        }
        for (i, name) in self.covariance_of.iter().enumerate() {
            let Some(own) = self.quantities.iter_mut().find(|own| own.name == *name) else { continue };
            own.value = own.value.map(|own| own - with_it[i] * value / sum);
            own.se = Some(libm::sqrt(self.covariance[i][i]));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::super::rig_calibration::{CalibratedQuantity, RigCalibration, RigQuantity};
    use crate::dataset::NoiseSpectrum;

    /// A gain of 1.05 and a nonlinearity that weights of 1 N m left open; together they are known to a thousandth at 1 N m.
    fn of_small_weights() -> RigCalibration {
        let known = [(RigQuantity::TorqueGain, 1.05, 0.04), (RigQuantity::TorqueNonlinearity, -0.05, 0.04)];
        let quantities = RigQuantity::ALL.map(|name| {
            let own = known.iter().find(|own| own.0 == name);
            CalibratedQuantity {
                name,
                value: own.map(|own| own.1),
                se: own.map(|own| own.2),
                stated: None,
                reason: own.is_none().then(|| "not told".into()),
                above: None,
            }
        });
        let [own, shared] = [0.0016, -0.0016 + 5e-7];
        let covariance = vec![vec![own, shared], vec![shared, own]];
        let mut own = RigCalibration::new("test".into(), "test".into(), quantities.to_vec(), covariance);
        own.noise.torque_nm = 0.01;
        own.noise.spectrum = NoiseSpectrum { frequency_hz: vec![2.0], power_nm2_per_hz: vec![1e-7] };
        own
    }

    #[test]
    fn a_nonlinearity_that_the_weights_leave_open_is_what_sensors_can_have() {
        let found = of_small_weights().at_torques_up_to(4.0);
        let [cubic, gain] = [RigQuantity::TorqueNonlinearity, RigQuantity::TorqueGain];
        let [value, se] = [found.value(cubic).unwrap(), found.se(cubic).unwrap()];
        assert!(value.abs() * 16.0 < 0.1 && 1.96 * se * 16.0 < 0.1, "{value} {se}");
        // What the weights tell of both together stays.
        assert!((found.value(gain).unwrap() + value - 1.0).abs() < 1e-3);
        assert!(found.se(gain).unwrap() < 0.004);
        RigCalibration::parse(std::str::from_utf8(&found.text()).unwrap(), "test".as_ref()).unwrap();
    }

    #[test]
    fn what_the_weights_tell_is_left_as_it_is() {
        let of_one = of_small_weights();
        assert_eq!(of_one.clone().at_torques_up_to(1.0), of_one);
    }
}
