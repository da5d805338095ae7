//! Covariance of the fitted coordinates: under the noise model, and from the scatter of whole trials.

use nalgebra::{DMatrix, DVector};

use super::constants::{FIRST_KNOWN, REPORTED, SERVO_PLACE};
use super::error::CalibrateError;
use super::fit::{RigFit, RigFitInput};
use super::linear_algebra::inverse;
use super::moments::MomentChannel;
use crate::statistics::t_quantile;

/// Precision of a coordinate of which nothing is assumed: a hundred times what engineering allows.
pub const NOTHING_KNOWN: f64 = 1e-4;

/// Smallest part of a direction's variance that the fit leaves in a trial's own residual; below, it is rounding.
const LEFT_IN_RESIDUAL: f64 = 1e-9;

/// Normal quantile of a 95 % interval.
pub const INTERVAL: f64 = 1.959_963_984_540_054;

/// Covariances of a fit.
pub struct RigCovariance {
    /// The larger one of both kinds of standard errors, with the correlations of the noise model.
    pub covariance: DMatrix<f64>,
    /// Standard error of each coordinate from the data and the stated loads alone.
    pub data_se: DVector<f64>,
    /// Information of data and stated loads.
    pub information: DMatrix<f64>,
}

impl RigCovariance {
    /// Covariance of the coordinates from the data and the stated loads alone, without what the scatter of whole trials adds.
    ///
    /// # Errors
    /// If the information has no inverse.
    pub fn of_data(&self) -> Result<DMatrix<f64>, CalibrateError> {
        let size = self.information.nrows();
        inverse(&self.information + DMatrix::identity(size, size) * NOTHING_KNOWN).ok_or(OF_CONSTANTS)
    }
}

/// The error of a fit whose constants have no covariance.
const OF_CONSTANTS: CalibrateError = CalibrateError::NoCovariance("the covariance of the fitted constants");

/// Covariances of the coordinates of a fit.
///
/// # Errors
/// If the information of the trials has no inverse.
pub fn covariance(input: &RigFitInput<'_>, fit: &RigFit) -> Result<RigCovariance, CalibrateError> {
    let size = input.coordinates.count();
    let prior = input.prior.precision.diagonal();
    let of_data = fit.information();
    // The noise is white in these units, the steps of the encoder included; their errors that repeat come on top.
    let scores = &of_data + step_covariance(fit, size);
    let known = DVector::from_fn(size, |place, _| if place < FIRST_KNOWN { 0.0 } else { prior[place] });
    // A prior that is a measurement counts as one; the others only keep the inverse finite.
    let with = |others: f64| {
        let all = known.map(|own| if own > 0.0 { own } else { others });
        let inverse = inverse(&of_data + DMatrix::from_diagonal(&all)).ok_or(OF_CONSTANTS)?;
        let meat = &scores + DMatrix::from_diagonal(&all);
        Ok((&inverse * meat * &inverse, inverse))
    };
    let (model, inverse) = with(1.0)?;
    let (data, _) = with(NOTHING_KNOWN)?;
    let clustered = clustered_se(fit, &inverse, &known);
    let growth =
        DVector::from_fn(size, |place, _| (clustered[place] / libm::sqrt(model[(place, place)])).max(1.0));
    let grown =
        DMatrix::from_fn(size, size, |row, column| model[(row, column)] * growth[row] * growth[column]);
    Ok(RigCovariance {
        covariance: grown,
        data_se: DVector::from_fn(size, |place, _| libm::sqrt(data[(place, place)]) * growth[place]),
        information: of_data + DMatrix::from_diagonal(&known),
    })
}

/// Covariance of the sum of derivative times residual by the errors of the encoder's steps, which are the same in all trials of one
/// motion.
fn step_covariance(fit: &RigFit, size: usize) -> DMatrix<f64> {
    let mut sum = DMatrix::zeros(size, size);
    let positions = fit.equations.first().map_or(0, |equations| equations.step_errors.len());
    for position in 0..positions {
        let mut score = DVector::zeros(size);
        for equations in &fit.equations {
            score += equations.jacobian.transpose() * &equations.step_errors[position];
        }
        sum += &score * score.transpose() / positions as f64;
    }
    sum
}

/// Standard errors from the scatter of whole trials: the bias-reduced sandwich of Bell and McCaffrey (2002), with their degrees of
/// freedom, so that 1.96 of them make a 95 % interval.
fn clustered_se(fit: &RigFit, inverse: &DMatrix<f64>, known: &DVector<f64>) -> DVector<f64> {
    let size = inverse.nrows();
    let (mut variance, mut expected, mut squares) =
        (DVector::<f64>::zeros(size), DVector::<f64>::zeros(size), DVector::<f64>::zeros(size));
    for equations in &fit.equations {
        let gain = inverse * equations.jacobian.transpose();
        let left = DMatrix::identity(equations.residual.len(), equations.residual.len())
            - &equations.jacobian * &gain;
        let eigen = left.symmetric_eigen();
        let grown = eigen
            .eigenvalues
            .map(|value| if value > LEFT_IN_RESIDUAL { 1.0 / libm::sqrt(value) } else { 0.0 });
        let residual = &eigen.eigenvectors
            * grown.component_mul(&(eigen.eigenvectors.transpose() * &equations.residual));
        let contribution = &gain * residual;
        for place in 0..size {
            variance[place] += contribution[place] * contribution[place];
            let own = gain.row(place).norm_squared();
            expected[place] += own;
            squares[place] += own * own;
        }
    }
    DVector::from_fn(size, |place, _| {
        let of_known: f64 =
            (0..size).map(|own| inverse[(place, own)] * inverse[(place, own)] * known[own]).sum();
        if squares[place] == 0.0 {
            return libm::sqrt(of_known);
        }
        let freedom = expected[place] * expected[place] / squares[place];
        // With less than two trials' worth there is no scatter to judge by.
        if freedom < 2.0 {
            return 0.0;
        }
        let factor = t_quantile(0.975, freedom) / INTERVAL;
        libm::sqrt(of_known + variance[place] * factor * factor)
    })
}

/// Mean square of the moments of some channels, in standard deviations; the coordinates are few beside the moments.
pub fn mean_square(fit: &RigFit, of: fn(MomentChannel) -> bool) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for own in &fit.equations {
        for (label, value) in own.labels.iter().zip(own.standardised.iter()) {
            if of(label.channel) {
                sum += value * value;
                count += 1.0;
            }
        }
    }
    if count > 0.0 { sum / count } else { 0.0 }
}

/// Covariance of the constants at a fit. Where the model leaves more than the noise, that of the constants that follow from the torque grows
/// as much.
///
/// # Errors
/// As [`covariance`].
pub fn grown_covariance(input: &RigFitInput<'_>, fit: &RigFit) -> Result<RigCovariance, CalibrateError> {
    let mut found = covariance(input, fit)?;
    let growth = libm::sqrt(mean_square(fit, |channel| channel != MomentChannel::Servo).max(1.0));
    let is_of_torque = |place: usize| place != SERVO_PLACE && place < REPORTED;
    for row in 0..found.covariance.nrows() {
        for column in 0..found.covariance.ncols() {
            let factor = |place: usize| if is_of_torque(place) { growth } else { 1.0 };
            found.covariance[(row, column)] *= factor(row) * factor(column);
        }
        found.data_se[row] *= if is_of_torque(row) { growth } else { 1.0 };
    }
    Ok(found)
}
