//! Rigs that differ from their calibration as the calibration's covariance says.

use ramphold::dataset::{CalibratedQuantity, RigCalibration, RigQuantity};
use ramphold::fit::{CalibrationMisuse, RigConstants};
use ramphold::random::Stream;
use ramphold::rig::virtual_wrist::{MechanismList, Setup};
use ramphold::wrist::Lever;
use ramphold::wrist::mechanisms::MechanismKind;

/// What standard errors do with the errors of a calibration.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum RigErrors {
    /// They contain them.
    Known,
    /// They ignore them.
    Ignored,
}

/// Standard errors of the calibration: of a delay in s, of the others as parts of the value. Three times those of careful rig trials, so
/// that they weigh as much as the noise.
const ERRORS: [(RigQuantity, f64); 6] = [
    (RigQuantity::LeverInertia, 0.03),
    (RigQuantity::LeverDamping, 0.05),
    (RigQuantity::LeverStiffness, 0.03),
    (RigQuantity::TorqueGain, 0.02),
    (RigQuantity::AngleGain, 0.01),
    (RigQuantity::TorqueDelay, 3e-5),
];

/// Correlation of the errors of torque gain and lever stiffness, which one weight and one stop decide together.
const CORRELATION: f64 = 0.5;

/// A calibration that says of every constant what the session states, with [`ERRORS`].
pub fn calibration_of(stated: Option<Lever>) -> RigCalibration {
    let constants = RigConstants::stated(stated);
    let quantity = |name: RigQuantity| {
        let error = ERRORS.iter().find(|(own, _)| *own == name).map(|(_, error)| *error);
        let value = error.and(constants.value(name));
        let scale = |value: f64| if name == RigQuantity::TorqueDelay { 1.0 } else { value };
        CalibratedQuantity {
            name,
            value,
            se: value.zip(error).map(|(value, error)| scale(value) * error),
            stated: constants.value(name),
            reason: value.is_none().then(|| "not among the constants that are drawn".to_owned()),
            above: None,
        }
    };
    let quantities: Vec<CalibratedQuantity> = RigQuantity::ALL.map(quantity).to_vec();
    let known: Vec<&CalibratedQuantity> = quantities.iter().filter(|own| own.value.is_some()).collect();
    let together = [RigQuantity::LeverStiffness, RigQuantity::TorqueGain];
    let covariance = |one: &CalibratedQuantity, other: &CalibratedQuantity| {
        let correlation = match one.name == other.name {
            true => 1.0,
            false if together.contains(&one.name) && together.contains(&other.name) => CORRELATION,
            false => 0.0,
        };
        correlation * one.se.unwrap_or(0.0) * other.se.unwrap_or(0.0)
    };
    let covariance =
        known.iter().map(|one| known.iter().map(|other| covariance(one, other)).collect()).collect();
    RigCalibration::new("coverage".into(), "drawn".into(), quantities, covariance)
}

/// Constants drawn from a calibration and its covariance.
pub fn drawn_constants(
    calibration: &RigCalibration,
    stated: Option<Lever>,
    seed: u64,
) -> Result<RigConstants, CalibrationMisuse> {
    let mut stream = Stream::new(seed, "constants of the rig");
    let count = calibration.covariance.len();
    let covariance = nalgebra::DMatrix::from_fn(count, count, |i, j| calibration.covariance[i][j]);
    let scale = covariance.diagonal().map(f64::sqrt);
    let correlation =
        nalgebra::DMatrix::from_fn(count, count, |i, j| covariance[(i, j)] / scale[i] / scale[j]);
    let factor = correlation.cholesky().expect("a correlation of one half is positive definite").l();
    let normal = nalgebra::DVector::from_fn(count, |_, _| stream.normal());
    let errors = (factor * normal).component_mul(&scale);
    let constants = RigConstants::calibrated(calibration, stated)?;
    let all = calibration.covariance_of.iter().zip(errors.iter());
    Ok(all.fold(constants, |own, (quantity, error)| {
        own.with(*quantity, own.value(*quantity).unwrap_or(0.0) + error)
    }))
}

/// A virtual rig with these constants.
pub fn with_constants(setup: Setup, constants: &RigConstants) -> Setup {
    let channels: MechanismList = [
        (MechanismKind::TorqueGain, vec![constants.torque_gain]),
        (MechanismKind::AngleGain, vec![constants.angle_gain]),
        (MechanismKind::ChannelSkew, vec![constants.torque_delay_s]),
    ]
    .into_iter()
    .collect();
    Setup { lever: constants.lever, mechanisms: setup.mechanisms.and(&channels), ..setup }
}
