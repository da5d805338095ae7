//! How much of the freedom that its priors declare a model uses: of the laws of its mechanisms, of their sizes, and of the errors of the angle.
//!
//! The checks of what a model leaves do not see what such a freedom has taken up, however much of it that is.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};

use crate::statistics::chi_square_tail;
use crate::wrist::mechanisms::MechanismKind;

/// Part of its prior variance that the session must take off a direction for that to count: with more than half, the session says more of it
/// than the prior. Of the others the most probable value is as uncertain as Laplace's approximation.
const LEAST_INFORMATION: f64 = 0.5;

/// What a model may do with a declared standard deviation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Freedom {
    /// This free law, by which the laws of its mechanisms may deviate.
    Law(MechanismKind),
    /// The size of this mechanism, which may go with order, torque and velocity.
    Size(MechanismKind),
    /// The errors of the angle and the drifts of measured constants of the rig, which trials share.
    SharedErrors,
}

/// A freedom with the use that a session makes of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UsedFreedom {
    /// The freedom.
    pub freedom: Freedom,
    /// Probability of using as much, if what was declared is right.
    pub p_value: f64,
}

/// The smallest p-value of several freedoms, corrected for their number (Bonferroni); 1 if there is none.
pub fn smallest_p_value(used: &[UsedFreedom]) -> f64 {
    let smallest = used.iter().map(|own| own.p_value).fold(1.0, f64::min);
    (used.len() as f64 * smallest).min(1.0)
}

/// The p-value of the unknowns `places`, whose most probable values are `values`, about zero, with the prior precision and the posterior
/// covariance of all unknowns. `None` if it cannot be computed.
///
/// If a prior is right, the most probable values scatter about its mean with its covariance less the posterior's (the law of total
/// variance). Along each principal direction the square relative to that variance is a chi-square (Box 1980 calls the whole a predictive
/// check of the prior).
pub fn p_value_of(
    places: &Range<usize>,
    values: &DVector<f64>,
    precision: &DMatrix<f64>,
    covariance: &DMatrix<f64>,
) -> Option<f64> {
    let block =
        |of: &DMatrix<f64>| of.view((places.start, places.start), (places.len(), places.len())).into_owned();
    let factor = block(precision).cholesky()?.l();
    let whitened = factor.transpose() * values.rows(places.start, places.len());
    let information =
        DMatrix::identity(places.len(), places.len()) - factor.transpose() * block(covariance) * &factor;
    let principal = information.symmetric_eigen();
    let along = principal.eigenvectors.transpose() * whitened;
    let (mut chi_square, mut degrees) = (0.0, 0);
    for (value, information) in along.iter().zip(principal.eigenvalues.iter()) {
        if *information > LEAST_INFORMATION {
            chi_square += value * value / information;
            degrees += 1;
        }
    }
    Some(if degrees == 0 { 1.0 } else { chi_square_tail(chi_square, f64::from(degrees)) })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::Stream;

    /// p-values of `count` sessions in which a trial of noise 1 sees two of three unknowns, of standard deviation `sd` where the prior
    /// declares 1.
    fn p_values(sd: f64, count: usize) -> Vec<f64> {
        let seen = DMatrix::from_row_slice(3, 3, &[2.0, 1.0, 0.0, 0.5, -1.5, 0.0, 0.0, 0.0, 0.0]);
        let precision = DMatrix::identity(3, 3);
        let covariance = (seen.transpose() * &seen + &precision).try_inverse().unwrap();
        let mut stream = Stream::new(7, "used freedom");
        let mut draw = |sd: f64| DVector::from_fn(3, |_, _| sd * stream.normal());
        let session = |_| {
            let measured = &seen * draw(sd) + draw(1.0);
            let values = &covariance * seen.transpose() * measured;
            p_value_of(&(0..3), &values, &precision, &covariance).unwrap()
        };
        (0..count).map(session).collect()
    }

    #[test]
    fn a_freedom_within_what_was_declared_has_p_values_of_any_size_alike() {
        let p_values = p_values(1.0, 4000);
        for level in [0.01, 0.1, 0.5] {
            let share = p_values.iter().filter(|p| **p < level).count() as f64 / 4000.0;
            assert!((share - level).abs() < 4.0 * (level / 4000.0f64).sqrt(), "{level}: {share}");
        }
    }

    #[test]
    fn a_freedom_beyond_what_was_declared_has_a_small_p_value() {
        let p_values = p_values(6.0, 400);
        assert!(p_values.iter().filter(|p| **p < 0.01).count() > 300);
    }

    #[test]
    fn of_what_a_session_does_not_show_nothing_is_said() {
        let identity = DMatrix::identity(2, 2);
        assert_eq!(p_value_of(&(0..2), &DVector::from_element(2, 9.0), &identity, &identity), Some(1.0));
    }
}
