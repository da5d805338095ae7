//! The check of the day: whether a few trials with the empty handle agree with a calibration, and which quantity differs if not.

use nalgebra::{DMatrix, DVector};

use super::calibration::fit_with_scatter;
use super::constants::{CoordinateScale, REPORTED, RigCoordinates};
use super::covariance::INTERVAL;
use super::error::CalibrateError;
use super::fit::{RigFit, RigFitInput, RigPrior};
use super::input_check::refuse_contradictions;
use super::linear_algebra::inverse;
use super::misfit::square_root;
use super::prepared_rig::PreparedRig;
use crate::dataset::{RigCalibration, RigQuantity, RigTrial, RigTrialMotion, RigTrials, time_constant_s};
use crate::protocol::RigLoad;
use crate::statistics::{chi_square_tail, holm, t_two_sided};
use crate::wrist::Lever;

/// Significance level over all quantities.
pub const DIFFERENCE_LEVEL: f64 = 0.05;

/// Significance level of a difference that no quantity explains. The level of the named ones is spent already: at the same level, every
/// twentieth day on which nothing changed would be an alarm a second time.
pub const UNEXPLAINED_LEVEL: f64 = 0.01;

/// Degrees of freedom of a normal distribution.
const MANY: f64 = 1e9;

/// How much one quantity differs from a calibration, if it alone does.
#[derive(Debug, Clone, PartialEq)]
pub struct QuantityDifference {
    /// Which one.
    pub name: RigQuantity,
    /// Its value in the calibration.
    pub calibrated: f64,
    /// Today's value less that of the calibration, in the same unit.
    pub difference: f64,
    /// Standard error of the difference, that of the calibration included.
    pub se: f64,
    /// Probability of a difference this large by chance, adjusted for the number of quantities by Holm's method.
    pub p_value: f64,
}

/// Comparison of today's trials with a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct RigComparison {
    /// Each quantity that the calibration has and these trials can see, first the one whose change explains the trials best.
    pub quantities: Vec<QuantityDifference>,
    /// The quantity that differs, if one does, and those that explain the trials as well: one of them changed.
    pub changed: Vec<RigQuantity>,
    /// Quantities that the calibration has and whose difference these trials should tell, but did not come out as a number.
    pub untested: Vec<RigQuantity>,
    /// Number of trials.
    pub trials: usize,
    /// Probability of trials so different if nothing changed; NaN if it cannot be computed.
    pub p_value: f64,
}

/// What a comparison says of the rig.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum RigVerdict<'a> {
    /// The trials were compared, and are as the calibration has them.
    Agrees,
    /// One of these quantities changed.
    Differs(&'a [RigQuantity]),
    /// The trials differ from the calibration at [`UNEXPLAINED_LEVEL`], and a change of no single quantity explains it.
    DiffersUnexplained,
    /// Nothing can be said, for this reason.
    NotComparable(&'static str),
}

impl RigVerdict<'_> {
    /// Name in the results of the program.
    pub fn name(self) -> &'static str {
        match self {
            Self::Agrees => "agrees",
            Self::Differs(_) => "differs",
            Self::DiffersUnexplained => "differs_unexplained",
            Self::NotComparable(_) => "not_comparable",
        }
    }
}

impl RigComparison {
    /// What the comparison says of the rig. That no quantity is named is agreement only if the trials could have named one, and if all of
    /// them together do not differ either.
    pub fn verdict(&self) -> RigVerdict<'_> {
        if !self.changed.is_empty() {
            return RigVerdict::Differs(&self.changed);
        }
        if self.p_value < UNEXPLAINED_LEVEL {
            return RigVerdict::DiffersUnexplained;
        }
        if self.p_value.is_nan() {
            return RigVerdict::NotComparable(
                "how far the trials differ from the calibration is not a number",
            );
        }
        if !self.untested.is_empty() {
            return RigVerdict::NotComparable("the difference of a quantity is not a number");
        }
        if self.quantities.is_empty() {
            return RigVerdict::NotComparable(
                "these trials tell a change of none of the calibrated quantities",
            );
        }
        RigVerdict::Agrees
    }
}

/// Compares the empty-handle trials of a session with a calibration of another one.
///
/// The calibration's values and covariance are the prior. Each quantity is tested alone: the others stay within the calibration's
/// uncertainty.
///
/// # Errors
/// If there are no trials with the empty handle in motion, if they contradict what is stated of them, if the calibration has no values, or if its
/// covariance has no inverse.
pub fn compare(trials: &RigTrials, calibration: &RigCalibration) -> Result<RigComparison, CalibrateError> {
    if calibration.covariance_of.is_empty() {
        return Err(CalibrateError::NothingCalibrated(calibration.session.clone()));
    }
    let of_the_empty_handle =
        |trial: &RigTrial| trial.load == RigLoad::EmptyHandle && trial.motion != RigTrialMotion::Still;
    let prepared = PreparedRig::new(trials, of_the_empty_handle, Some(&calibration.noise.spectrum)).map_err(
        |error| if error == CalibrateError::NoMotion { CalibrateError::NoEmptyHandle } else { error },
    )?;
    refuse_contradictions(&prepared, calibrated_lever(calibration).or(trials.lever))?;
    let coordinates = RigCoordinates::new(trials.lever, prepared.largest_nm, Vec::new());
    let (prior, prior_covariance) = calibrated_prior(&coordinates, calibration)?;
    let mean = prior.mean.clone();
    let mut input = RigFitInput {
        trials: &prepared.trials,
        coordinates,
        prior,
        noise: &prepared.noise,
        mean_sd_nm: prepared.mean_sd_nm,
        friction_speed_rad_s: prepared.friction_speed_rad_s,
        torque_scale: 1.0,
        servo_scale: 1.0,
    };
    let fit = fit_with_scatter(&mut input)?;

    let unchanged = Linearised::new(&input, &fit, &mean, &prior_covariance)?;
    let (mut found, mut untested) = (Vec::new(), Vec::new());
    for name in &calibration.covariance_of {
        let place = RigQuantity::ALL.iter().position(|own| own == name).unwrap_or_default();
        if unchanged.change(place).is_none_or(|(_, se)| INTERVAL * se > 1.0) {
            // A change that would show only beyond what engineering allows is not seen by these trials.
            continue;
        }
        // The constants that fit best if this one changed, and what is then left unexplained.
        let mut free = prior_covariance.clone();
        free[(place, place)] += 1.0;
        input.prior.precision = inverse(free).ok_or_else(|| singular(calibration))?;
        let fit = input.fit(&fit.point)?;
        let left = fit.equations.iter().map(|own| own.residual.norm_squared()).sum::<f64>()
            + input.prior.misfit(&fit.point);
        let change = Linearised::new(&input, &fit, &mean, &prior_covariance)?.change(place);
        let is_number = |(difference, se): &(f64, f64)| (difference / se).is_finite();
        let Some((difference, se)) = change.filter(is_number) else {
            untested.push(*name);
            continue;
        };
        let calibrated = calibration.value(*name).unwrap_or(f64::NAN);
        let slope = natural_slope(*name, input.coordinates.scales[place], calibrated);
        let own = QuantityDifference {
            name: *name,
            calibrated,
            difference: difference * slope,
            se: se * slope.abs(),
            p_value: t_two_sided(difference / se, MANY),
        };
        found.push((left, own));
    }
    let p: Vec<f64> = found.iter().map(|(_, own)| own.p_value).collect();
    for ((_, own), p_value) in found.iter_mut().zip(holm(&p)) {
        own.p_value = p_value;
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    let changed = changed_of(&found);
    Ok(RigComparison {
        changed,
        untested,
        trials: prepared.trials.len(),
        p_value: unchanged.p_value(),
        quantities: found.into_iter().map(|(_, own)| own).collect(),
    })
}

/// The quantity that differs and leaves the least unexplained, with those that leave not significantly more. `found` has what each leaves,
/// in order.
fn changed_of(found: &[(f64, QuantityDifference)]) -> Vec<RigQuantity> {
    let differing = || found.iter().filter(|(_, own)| own.p_value < DIFFERENCE_LEVEL);
    let Some((least, _)) = differing().next() else { return Vec::new() };
    let most = least + INTERVAL * INTERVAL;
    // What leaves no number cannot be set behind another one: it differs all the same.
    differing().filter(|(left, _)| *left < most || !left.is_finite()).map(|(_, own)| own.name).collect()
}

/// The lever of a calibration that tells all of it.
fn calibrated_lever(calibration: &RigCalibration) -> Option<Lever> {
    Some(Lever {
        inertia_kg_m2: calibration.value(RigQuantity::LeverInertia)?,
        damping_nm_s_per_rad: calibration.value(RigQuantity::LeverDamping)?,
        stiffness_nm_per_rad: calibration.value(RigQuantity::LeverStiffness)?,
    })
}

/// All trials as one system that is linear about a fit, with the constants at the calibration's values.
struct Linearised {
    jacobian: DMatrix<f64>,
    residual: DVector<f64>,
    /// Inverse covariance of the residual if nothing changed.
    weights: DMatrix<f64>,
    /// Its covariance, with the errors of the encoder's steps that repeat.
    covariance: DMatrix<f64>,
}

impl Linearised {
    fn new(
        input: &RigFitInput<'_>,
        fit: &RigFit,
        mean: &DVector<f64>,
        prior_covariance: &DMatrix<f64>,
    ) -> Result<Self, CalibrateError> {
        let rows: usize = fit.equations.iter().map(|own| own.residual.len()).sum();
        let size = input.coordinates.count();
        let mut jacobian = DMatrix::zeros(rows, size);
        let mut residual = DVector::zeros(rows);
        let positions = fit.equations.first().map_or(0, |own| own.step_errors.len());
        let mut steps = DMatrix::zeros(rows, positions);
        let mut from = 0;
        for own in &fit.equations {
            let count = own.residual.len();
            jacobian.view_mut((from, 0), (count, size)).copy_from(&own.jacobian);
            residual.rows_mut(from, count).copy_from(&own.residual);
            for (position, error) in own.step_errors.iter().enumerate() {
                steps.view_mut((from, position), (count, 1)).copy_from(error);
            }
            from += count;
        }
        residual += &jacobian * (mean - &fit.point);
        let of_prior = &jacobian * square_root(prior_covariance);
        let white = &of_prior * of_prior.transpose() + DMatrix::identity(rows, rows);
        let weights = inverse(white.clone())
            .ok_or(CalibrateError::NoCovariance("the covariance of today's residuals"))?;
        // The steps of the encoder count twice: as white, and as the errors of one motion that repeat.
        let covariance = white + &steps * steps.transpose() / positions.max(1) as f64;
        Ok(Self { jacobian, residual, weights, covariance })
    }

    /// Change of one coordinate that explains the residual best if the others did not change, and its standard error; `None` if it has
    /// no effect.
    fn change(&self, place: usize) -> Option<(f64, f64)> {
        let column = self.jacobian.column(place).clone_owned();
        let weighted = &self.weights * &column;
        let information = column.dot(&weighted);
        let variance = weighted.dot(&(&self.covariance * &weighted));
        // Information that is no number is no lack of effect.
        (information > 0.0 || information.is_nan())
            .then(|| (-weighted.dot(&self.residual) / information, libm::sqrt(variance) / information))
    }

    /// Probability of differences this large, of all reported quantities together.
    fn p_value(&self) -> f64 {
        let weighted = &self.weights * self.jacobian.columns(0, REPORTED).clone_owned();
        let score = weighted.transpose() * &self.residual;
        let eigen = (weighted.transpose() * &self.covariance * &weighted).symmetric_eigen();
        let largest = eigen.eigenvalues.amax();
        let (mut sum, mut freedom) = (0.0, 0.0);
        for (place, value) in eigen.eigenvalues.iter().enumerate() {
            // Directions without information have only rounding in them.
            if *value > largest * 1e-10 {
                let along = eigen.eigenvectors.column(place).dot(&score);
                sum += along * along / value;
                freedom += 1.0;
            }
        }
        chi_square_tail(sum, freedom)
    }
}

fn singular(calibration: &RigCalibration) -> CalibrateError {
    CalibrateError::SingularCalibration(calibration.session.clone())
}

/// The calibration as a prior of the coordinates; those without a value have what engineering allows.
fn calibrated_prior(
    coordinates: &RigCoordinates,
    calibration: &RigCalibration,
) -> Result<(RigPrior, DMatrix<f64>), CalibrateError> {
    let size = coordinates.count();
    let mut mean = DVector::zeros(size);
    let mut covariance = DMatrix::identity(size, size);
    let place = |name: RigQuantity| RigQuantity::ALL.iter().position(|own| *own == name).unwrap_or_default();
    // Change of a quantity with its coordinate, over its standard error.
    let slope = |name: RigQuantity| {
        let [value, se] = [calibration.value(name), calibration.se(name)].map(|own| own.unwrap_or(f64::NAN));
        coordinates.scales[place(name)].range() * se / name.normal_error(value, se)
    };
    for (row, name) in calibration.covariance_of.iter().enumerate() {
        let value = calibration.value(*name).unwrap_or(f64::NAN);
        let of_coordinate = if name.is_frequency() { time_constant_s(value) } else { value };
        mean[place(*name)] = coordinates.scales[place(*name)].coordinate(of_coordinate);
        for (column, other) in calibration.covariance_of.iter().enumerate() {
            covariance[(place(*name), place(*other))] =
                calibration.covariance[row][column] / (slope(*name) * slope(*other));
        }
    }
    let precision = inverse(covariance.clone()).ok_or_else(|| singular(calibration))?;
    Ok((RigPrior { mean, precision }, covariance))
}

/// Change of a quantity with its coordinate, at a value of the quantity.
fn natural_slope(name: RigQuantity, scale: CoordinateScale, value: f64) -> f64 {
    match scale {
        CoordinateScale::Factor { range, .. } => value * range,
        CoordinateScale::Linear { range, .. } if name.is_frequency() => {
            -range * std::f64::consts::TAU * value * value
        }
        CoordinateScale::Linear { range, .. } => range,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn difference(name: RigQuantity, p_value: f64) -> QuantityDifference {
        QuantityDifference { name, calibrated: 1.0, difference: 0.1, se: 0.01, p_value }
    }

    fn comparison(changed: Vec<RigQuantity>, p_value: f64) -> RigComparison {
        let quantities = vec![difference(RigQuantity::TorqueOffset, 0.4)];
        RigComparison { quantities, changed, untested: Vec::new(), trials: 3, p_value }
    }

    #[test]
    fn a_rig_agrees_only_if_it_could_be_compared_and_nothing_differs() {
        assert_eq!(comparison(Vec::new(), 0.4).verdict(), RigVerdict::Agrees);
        let named = comparison(vec![RigQuantity::TorqueOffset], f64::NAN);
        assert_eq!(named.verdict(), RigVerdict::Differs(&[RigQuantity::TorqueOffset]));
        assert_eq!(comparison(Vec::new(), 0.0).verdict(), RigVerdict::DiffersUnexplained);
        // Not at the level of the named quantities, which would be an alarm too often where nothing changed.
        assert_eq!(comparison(Vec::new(), 0.03).verdict(), RigVerdict::Agrees);
        let is_not_comparable = |own: RigComparison| matches!(own.verdict(), RigVerdict::NotComparable(_));
        assert!(is_not_comparable(comparison(Vec::new(), f64::NAN)));
        assert!(is_not_comparable(RigComparison { quantities: Vec::new(), ..comparison(Vec::new(), 0.4) }));
        let untested = vec![RigQuantity::TorqueDelay];
        assert!(is_not_comparable(RigComparison { untested, ..comparison(Vec::new(), 0.4) }));
    }

    #[test]
    fn a_quantity_that_differs_is_named_even_if_what_it_leaves_is_no_number() {
        let [offset, gain] = [RigQuantity::TorqueOffset, RigQuantity::TorqueGain];
        let of = |left: [f64; 2]| {
            changed_of(&[(left[0], difference(offset, 0.001)), (left[1], difference(gain, 0.001))])
        };
        assert_eq!(of([10.0, 11.0]), [offset, gain]);
        assert_eq!(of([10.0, 20.0]), [offset]);
        assert_eq!(of([f64::NAN, f64::NAN]), [offset, gain]);
        assert_eq!(of([10.0, f64::NAN]), [offset, gain]);
    }
}
