//! The constants of a rig as its trials and its tolerances say together: where the trials tell a constant badly, and nothing says that it is
//! off, that it is as stated is known better.

use nalgebra::{DMatrix, DVector};

use crate::calibrate::ToldConstant;
use crate::dataset::{RigCalibration, RigQuantity};
use crate::fit::RigConstants;
use crate::wrist::mechanisms::MechanismKind;

/// Constants, and the independent errors that they may have.
#[derive(Debug, Clone)]
pub struct WeighedConstants {
    /// The most probable constants.
    pub constants: RigConstants,
    /// The constants with each error, of one standard deviation.
    pub errors: Vec<RigConstants>,
}

impl WeighedConstants {
    /// From the `measured` constants of `calibration`. Of the constants `told`, those that none of the causes `off` is about lie within their
    /// tolerance.
    ///
    /// With z the deviations from the measured values in standard errors, R their correlation, and p the prior precision of those within a
    /// tolerance about z_0, it is z ~ N(V p z_0, V) with V = (R^-1 + p)^-1 = R - R s (1 + s R s)^-1 s R and s = p^(1/2).
    pub fn of(
        calibration: &RigCalibration,
        measured: RigConstants,
        told: &[ToldConstant],
        off: &[MechanismKind],
    ) -> Self {
        let known = calibration.covariance_of.iter().copied();
        let quantities: Vec<RigQuantity> = known.filter(|own| measured.value(*own).is_some()).collect();
        let count = quantities.len();
        let se: Vec<f64> = quantities.iter().filter_map(|own| calibration.se(*own)).collect();
        let correlation = DMatrix::from_fn(count, count, |i, j| {
            calibration.covariance_between(quantities[i], quantities[j]).unwrap_or(0.0) / (se[i] * se[j])
        });
        let within_tolerance = quantities.iter().map(|quantity| {
            let own = told.iter().find(|own| own.quantity == *quantity && !off.contains(&own.kind))?;
            let (mean, sd) = own.priors.sound;
            let per_error = own.slope * own.se;
            Some(((mean - own.deviation) / per_error, (per_error / sd).abs()))
        });
        let within_tolerance: Vec<Option<(f64, f64)>> = within_tolerance.collect();
        let precision = |own: &Option<(f64, f64)>| own.map_or(0.0, |(_, root)| root);
        let root = DVector::from_iterator(count, within_tolerance.iter().map(precision));
        let weighted = DMatrix::from_diagonal(&root) * &correlation;
        let inner = DMatrix::identity(count, count) + &weighted * DMatrix::from_diagonal(&root);
        // Positive definite: the identity, and a part that is not negative.
        let inverse = inner.try_inverse().unwrap_or_else(|| DMatrix::zeros(count, count));
        let covariance = &correlation - weighted.transpose() * inverse * &weighted;
        let pull = |own: &Option<(f64, f64)>| own.map_or(0.0, |(mean, root)| root * root * mean);
        let mean = &covariance * DVector::from_iterator(count, within_tolerance.iter().map(pull));
        let at = |errors: &DVector<f64>| {
            quantities.iter().enumerate().fold(measured, |changed, (row, quantity)| {
                let value = measured.value(*quantity).unwrap_or(0.0);
                changed.with(*quantity, quantity.off_by(value, se[row], errors[row]))
            })
        };
        let eigen = covariance.symmetric_eigen();
        let with_error = |(place, variance): (usize, &f64)| {
            at(&(&mean + eigen.eigenvectors.column(place) * libm::sqrt(variance.max(0.0))))
        };
        Self { constants: at(&mean), errors: eigen.eigenvalues.iter().enumerate().map(with_error).collect() }
    }
}

#[cfg(test)]
mod tests {
    use crate::dataset::RigQuantity;
    use crate::diagnose::RigKnowledge;
    use crate::diagnose::test_session::{LEVER, measured_rig};
    use crate::fit::RigConstants;

    fn errors_of(knowledge: &RigKnowledge, value: fn(&RigConstants) -> f64) -> f64 {
        let about = value(&knowledge.constants);
        let squares = knowledge.errors.iter().map(|own| (value(own) - about) * (value(own) - about));
        libm::sqrt(squares.sum())
    }

    fn damping(of: &RigConstants) -> f64 {
        of.lever.unwrap().damping_nm_s_per_rad
    }

    #[test]
    fn a_constant_that_was_measured_badly_is_as_stated_within_its_tolerance() {
        let badly =
            measured_rig(&[(RigQuantity::LeverDamping, 0.9 * LEVER.damping_nm_s_per_rad, 0.24)], None);
        let (found, sd) = (damping(&badly.constants), errors_of(&badly, damping));
        assert!((found / LEVER.damping_nm_s_per_rad - 1.0).abs() < 0.002, "{found}");
        assert!((sd / (0.05 * LEVER.damping_nm_s_per_rad) - 1.0).abs() < 0.01, "{sd}");
    }

    #[test]
    fn a_constant_that_is_off_or_that_was_measured_well_is_as_measured() {
        let off = measured_rig(&[(RigQuantity::LeverDamping, 0.6, 0.02)], None);
        assert_eq!(damping(&off.constants), 0.6);
        assert!((errors_of(&off, damping) - 0.02).abs() < 1e-12);
        let well = measured_rig(&[(RigQuantity::TorqueGain, 1.004, 0.000_5)], None);
        assert!((well.constants.torque_gain - 1.004).abs() < 0.000_02, "{}", well.constants.torque_gain);
    }

    #[test]
    fn a_late_torque_keeps_its_delay_where_a_low_pass_may_be_its_cause() {
        let late = measured_rig(&[(RigQuantity::TorqueDelay, 0.001_06, 0.000_03)], Some(100.0));
        assert_eq!(late.constants.torque_delay_s, 0.001_06);
    }

    #[test]
    fn what_no_tolerance_is_known_of_is_as_measured() {
        let friction = measured_rig(&[(RigQuantity::BearingFriction, 0.01, 0.000_3)], None);
        assert_eq!(friction.constants.bearing_friction_nm, 0.01);
    }
}
