//! What a rig calibration cannot be: names, values and a covariance that contradict each other.

use super::rig_calibration::{
    CalibratedQuantity, CalibrationNoise, RIG_CALIBRATION_FORMAT, RigCalibration, RigQuantity, told,
};
use super::rig_calibration_range::check_possible;
use super::utc::{A_UTC_TIME, utc_seconds};
use crate::files::excerpt;

/// How far a covariance may be from symmetric, and its diagonal from the squares of the standard errors, as a part of the product of
/// both standard errors: the digits that other programs print.
const COVARIANCE_ROUNDING: f64 = 1e-6;

impl RigCalibration {
    /// The first field with a value that a calibration cannot have, and what is wrong with it.
    pub(super) fn check(&self) -> Result<(), (String, String)> {
        let wrong = |field: &str, message: String| Err((field.to_owned(), message));
        if self.format != RIG_CALIBRATION_FORMAT {
            return wrong("format", format!("\"{}\"; expected \"{RIG_CALIBRATION_FORMAT}\"", self.format));
        }
        for (field, time) in self.times() {
            if let Some(text) = time.filter(|text| utc_seconds(text).is_none()) {
                return wrong(field, format!("\"{}\"; expected {A_UTC_TIME}", excerpt(text)));
            }
        }
        let names: Vec<RigQuantity> = self.quantities.iter().map(|quantity| quantity.name).collect();
        if names != RigQuantity::ALL {
            let expected = RigQuantity::ALL.map(RigQuantity::name).join(", ");
            return wrong("quantities", format!("expected each of {expected} once, in this order"));
        }
        for (index, quantity) in self.quantities.iter().enumerate() {
            quantity.check().or_else(|message| wrong(&format!("quantities[{index}]"), message))?;
        }
        if self.covariance_of != told(&self.quantities) {
            return wrong(
                "covariance_of",
                "expected the quantities that have a value, in their order".into(),
            );
        }
        self.check_covariance()?;
        self.noise.check()?;
        if let Some(p) = self.fit.p_value_of_misfit.filter(|p| !(0.0..=1.0).contains(p)) {
            return wrong("fit.p_value_of_misfit", format!("{p}; expected a probability, 0 to 1"));
        }
        Ok(())
    }

    fn check_covariance(&self) -> Result<(), (String, String)> {
        let size = self.covariance_of.len();
        let wrong = |field: String, message: &str| Err((field, message.to_owned()));
        if self.covariance.len() != size || self.covariance.iter().any(|row| row.len() != size) {
            let message =
                format!("expected {size} rows of {size} numbers, as covariance_of has {size} names");
            return wrong("covariance".into(), &message);
        }
        let se: Vec<f64> = self.covariance_of.iter().filter_map(|name| self.se(*name)).collect();
        for (i, row) in self.covariance.iter().enumerate() {
            for (j, value) in row.iter().enumerate() {
                let field = || format!("covariance[{i}][{j}]");
                let scale = se[i] * se[j];
                if !value.is_finite() || value.abs() > scale * (1.0 + COVARIANCE_ROUNDING) {
                    return wrong(field(), "expected at most the product of both standard errors");
                }
                if (value - self.covariance[j][i]).abs() > COVARIANCE_ROUNDING * scale {
                    return wrong(field(), "the covariance is not symmetric");
                }
                if i == j && (value - scale).abs() > COVARIANCE_ROUNDING * scale {
                    return wrong(field(), "expected the square of the quantity's standard error");
                }
            }
        }
        if !is_positive_semidefinite(&self.covariance, &se) {
            let message = "no covariance: a combination of the quantities has a variance below zero";
            return wrong("covariance".into(), message);
        }
        Ok(())
    }
}

impl CalibrationNoise {
    /// The spectrum is that of a channel with noise: `calibrate` refuses one without.
    fn check(&self) -> Result<(), (String, String)> {
        let wrong = |field: &str, message: String| Err((format!("noise.{field}"), message));
        let is_above_0 = |value: f64| value.is_finite() && value > 0.0;
        if !is_above_0(self.torque_nm) {
            return wrong("torque_nm", format!("{}; expected a number above 0", self.torque_nm));
        }
        let (frequencies, powers) = (&self.spectrum.frequency_hz, &self.spectrum.power_nm2_per_hz);
        if frequencies.is_empty() {
            return wrong("spectrum.frequency_hz", "expected at least one frequency".into());
        }
        if let Some(place) = frequencies.iter().position(|hz| !(hz.is_finite() && *hz >= 0.0)) {
            let message = format!("{}; expected a number of 0 or above", frequencies[place]);
            return wrong(&format!("spectrum.frequency_hz[{place}]"), message);
        }
        if let Some(place) = frequencies.windows(2).position(|pair| pair[0] >= pair[1]) {
            let message = format!("{}; expected a frequency above the one before it", frequencies[place + 1]);
            return wrong(&format!("spectrum.frequency_hz[{}]", place + 1), message);
        }
        if powers.len() != frequencies.len() {
            let message = format!(
                "{} numbers; expected {}, one for each number of frequency_hz",
                powers.len(),
                frequencies.len()
            );
            return wrong("spectrum.power_nm2_per_hz", message);
        }
        if let Some(place) = powers.iter().position(|power| !(power.is_finite() && *power >= 0.0)) {
            let message = format!("{}; expected a number of 0 or above", powers[place]);
            return wrong(&format!("spectrum.power_nm2_per_hz[{place}]"), message);
        }
        if !powers.iter().any(|power| *power > 0.0) {
            return wrong("spectrum.power_nm2_per_hz", "all are 0; expected the power of the noise".into());
        }
        Ok(())
    }
}

impl CalibratedQuantity {
    fn check(&self) -> Result<(), String> {
        let name = self.name.name();
        if let Some(above) = self.above
            && !(self.value.is_none() && self.name.is_frequency() && above.is_finite() && above > 0.0)
        {
            return Err(format!(
                "{name} is above {above}; expected a frequency without a value to be above a number above 0"
            ));
        }
        match (self.value, self.se) {
            (None, None) if self.reason.is_some() => Ok(()),
            (None, None) => Err(format!("{name} has no value: expected a reason")),
            (Some(value), Some(se)) => {
                if !value.is_finite() || (self.name.is_positive() && value <= 0.0) {
                    Err(format!(
                        "{name} is {value}; expected a number{}",
                        if self.name.is_positive() { " above 0" } else { "" }
                    ))
                } else if !(se.is_finite() && se > 0.0) {
                    Err(format!("{name} has the standard error {se}; expected a number above 0"))
                } else {
                    check_possible(self.name, value, se)
                }
            }
            _ => Err(format!("{name}: expected a value with its standard error, or neither")),
        }
    }
}

/// Whether no combination of the quantities has a negative variance, beyond rounding; by Cholesky's factorisation of the correlations.
fn is_positive_semidefinite(covariance: &[Vec<f64>], se: &[f64]) -> bool {
    let size = se.len();
    let mut factor = vec![vec![0.0; size]; size];
    for i in 0..size {
        for j in 0..=i {
            let known: f64 = (0..j).map(|k| factor[i][k] * factor[j][k]).sum();
            let left = covariance[i][j] / (se[i] * se[j]) - known;
            if i == j {
                if left < -COVARIANCE_ROUNDING * size as f64 {
                    return false;
                }
                factor[i][i] = libm::sqrt(left.max(COVARIANCE_ROUNDING * COVARIANCE_ROUNDING));
            } else {
                factor[i][j] = left / factor[j][j];
            }
        }
    }
    true
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use super::*;
    use crate::dataset::NoiseSpectrum;
    use crate::wrist::Lever;

    fn calibration() -> RigCalibration {
        let quantity = |name: RigQuantity| {
            let known = match name {
                RigQuantity::LeverInertia => Some((0.0016, 1e-5)),
                RigQuantity::TorqueGain => Some((1.02, 0.002)),
                _ => None,
            };
            CalibratedQuantity {
                name,
                value: known.map(|(value, _)| value),
                se: known.map(|(_, se)| se),
                stated: None,
                reason: known.is_none().then(|| "no load tells it".to_owned()),
                above: (name == RigQuantity::TorqueCutoff).then_some(300.0),
            }
        };
        let covariance = vec![vec![1e-10, -1e-8], vec![-1e-8, 4e-6]];
        let mut own = RigCalibration::new(
            "ramphold".into(),
            "S01".into(),
            RigQuantity::ALL.map(quantity).to_vec(),
            covariance,
        );
        own.noise = CalibrationNoise {
            torque_nm: 0.01,
            spectrum: NoiseSpectrum {
                frequency_hz: vec![2.0, 3.0, 5.0],
                power_nm2_per_hz: vec![2e-7, 1e-7, 0.0],
            },
        };
        own.measured_utc = Some("2026-11-24T10:00:00Z".into());
        own
    }

    fn refusal(change: impl FnOnce(&mut RigCalibration)) -> String {
        let mut changed = calibration();
        change(&mut changed);
        let text = serde_json::to_string(&changed).unwrap();
        RigCalibration::parse(&text, Path::new("rig-calibration.json")).unwrap_err().to_string()
    }

    #[test]
    fn a_calibration_is_read_as_it_was_written() {
        let text = serde_json::to_string(&calibration()).unwrap();
        let read = RigCalibration::parse(&text, Path::new("c.json")).unwrap();
        assert_eq!(read, calibration());
        assert_eq!(read.covariance_between(RigQuantity::TorqueGain, RigQuantity::LeverInertia), Some(-1e-8));
        let stated = Lever { inertia_kg_m2: 0.002, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };
        let lever = read.lever(stated);
        assert_eq!((lever.inertia_kg_m2, lever.stiffness_nm_per_rad), (0.0016, 900.0));
    }

    #[test]
    fn a_calibration_that_contradicts_itself_is_refused_with_the_field() {
        let wrong = [
            (refusal(|c| c.format = "ramphold-rig-calibration/9".into()), "field format"),
            (refusal(|c| c.quantities.swap(0, 1)), "field quantities:"),
            (
                refusal(|c| c.quantities[0].value = Some(-1.0)),
                "field quantities[0]: lever_inertia_kg_m2 is -1",
            ),
            (
                refusal(|c| c.quantities[0].se = Some(0.0)),
                "field quantities[0]: lever_inertia_kg_m2 has the standard",
            ),
            (refusal(|c| c.quantities[0].se = None), "expected a value with its standard error"),
            (refusal(|c| c.quantities[1].reason = None), "expected a reason"),
            (
                refusal(|c| c.quantities[3].value = Some(5.0)),
                "field quantities[3]: torque_gain is 5; expected 0.333 to 3: a channel that is off by more is in another unit",
            ),
            (refusal(|c| c.covariance_of.truncate(1)), "field covariance_of"),
            (refusal(|c| c.covariance.truncate(1)), "expected 2 rows of 2"),
            (
                refusal(|c| c.covariance[0][1] = 0.0),
                "field covariance[0][1]: the covariance is not symmetric",
            ),
            (refusal(|c| c.covariance[0][0] = 0.5e-10), "field covariance[0][0]: expected the square"),
            (
                refusal(|c| (c.covariance[0][1], c.covariance[1][0]) = (1.0, 1.0)),
                "field covariance[0][1]: expected at most",
            ),
        ];
        for (message, expected) in wrong {
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_noise_that_no_channel_has_is_refused_with_the_field() {
        let noise = |change: fn(&mut CalibrationNoise)| refusal(|c| change(&mut c.noise));
        let wrong = [
            (noise(|n| n.torque_nm = 0.0), "field noise.torque_nm: 0; expected a number above 0"),
            (noise(|n| n.torque_nm = -1.0), "field noise.torque_nm: -1"),
            (
                noise(|n| *n = CalibrationNoise { torque_nm: 0.01, ..Default::default() }),
                "at least one frequency",
            ),
            (
                noise(|n| n.spectrum.power_nm2_per_hz.truncate(1)),
                "field noise.spectrum.power_nm2_per_hz: 1 numbers; expected 3",
            ),
            (noise(|n| n.spectrum.power_nm2_per_hz.push(1.0)), "4 numbers; expected 3"),
            (
                noise(|n| n.spectrum.power_nm2_per_hz[1] = -1e-7),
                "field noise.spectrum.power_nm2_per_hz[1]: -0.0000001; expected",
            ),
            (noise(|n| n.spectrum.power_nm2_per_hz.fill(0.0)), "all are 0"),
            (
                noise(|n| n.spectrum.frequency_hz.reverse()),
                "field noise.spectrum.frequency_hz[1]: 3; expected a frequency above",
            ),
            (noise(|n| n.spectrum.frequency_hz[1] = 2.0), "field noise.spectrum.frequency_hz[1]: 2"),
            (noise(|n| n.spectrum.frequency_hz[0] = -2.0), "field noise.spectrum.frequency_hz[0]: -2"),
        ];
        for (message, expected) in wrong {
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_probability_above_1_and_a_time_that_is_none_are_refused_with_the_field() {
        let wrong = [
            (refusal(|c| c.fit.p_value_of_misfit = Some(7.0)), "field fit.p_value_of_misfit: 7; expected"),
            (refusal(|c| c.fit.p_value_of_misfit = Some(-3.0)), "field fit.p_value_of_misfit: -3"),
            (
                refusal(|c| c.measured_utc = Some("yesterday".into())),
                "field measured_utc: \"yesterday\"; expected a time in UTC, such as 2026-11-24T15:00:00Z",
            ),
            (refusal(|c| c.made_utc = Some("2026-13-24T10:00:00Z".into())), "field made_utc: \"2026-13"),
        ];
        for (message, expected) in wrong {
            assert!(message.contains(expected), "{message}");
        }
    }

    #[test]
    fn a_covariance_with_a_negative_variance_is_found() {
        let se = [1.0; 3];
        let row = |a: f64, b: f64, c: f64| vec![a, b, c];
        let impossible = [row(1.0, 0.9, 0.9), row(0.9, 1.0, -0.9), row(0.9, -0.9, 1.0)];
        assert!(!is_positive_semidefinite(&impossible, &se));
        let together = [row(1.0, 1.0, 0.0), row(1.0, 1.0, 0.0), row(0.0, 0.0, 1.0)];
        assert!(is_positive_semidefinite(&together, &se));
    }
}
