//! Variances that are estimated, with their priors.

use nalgebra::{DMatrix, DVector};

use crate::fit::{SPREAD_DEGREES, SPREAD_SD};

/// Degrees of freedom of the prior of the noise's variance beside that of the holds. The hold predicts the variance of the noise in the
/// ramp to a fifth: the variance of a scaled inverse chi-square of this many degrees of freedom.
const NOISE_WEIGHT: f64 = 50.0;

/// Degrees of freedom of the prior of the variance of a free law: next to nothing is known of its size.
const LAW_WEIGHT: f64 = 1.0;

/// Prior of the coefficients of a free law: normal, of a smooth covariance whose size is estimated.
#[derive(Debug, Clone)]
pub struct FreeLawPrior {
    /// First common coordinate of the coefficients.
    pub first: usize,
    /// Precision of the coefficients for a variance of one.
    pub precision: DMatrix<f64>,
    /// Logarithm of the determinant of this precision.
    pub log_determinant: f64,
    /// Variance about which the prior of the size lies.
    pub variance: f64,
}

/// Estimated variances.
#[derive(Debug, Clone)]
pub struct Spreads {
    /// Of a trial about its condition, by own coordinate.
    pub trial: DVector<f64>,
    /// Of a condition about the regression.
    pub condition: DVector<f64>,
    /// Of the noise, by that of the holds.
    pub noise: f64,
    /// Of the coefficients of a free law.
    pub law: f64,
}

impl Spreads {
    /// Where the estimation starts: a little above the prior.
    pub fn start(own: usize, law_variance: f64) -> Self {
        let spread = DVector::from_element(own, 4.0 * SPREAD_SD * SPREAD_SD);
        Self { trial: spread.clone(), condition: spread, noise: 1.0, law: law_variance }
    }

    /// Negative logarithm of their prior density. `law` is a free law's.
    pub fn negative_log_prior(&self, law: Option<&FreeLawPrior>) -> f64 {
        let inverse_chi_square = |weight: f64, centre: f64, variance: f64| {
            let relative = centre / variance;
            0.5 * weight * (relative - libm::log(relative))
        };
        let spreads = self.trial.iter().chain(self.condition.iter());
        let mut cost: f64 =
            spreads.map(|own| inverse_chi_square(SPREAD_DEGREES, SPREAD_SD * SPREAD_SD, *own)).sum();
        cost += inverse_chi_square(NOISE_WEIGHT, 1.0, self.noise);
        if let Some(law) = law {
            cost += inverse_chi_square(LAW_WEIGHT, law.variance, self.law);
        }
        cost
    }
}

/// Expected sums of squares, from which the spreads follow.
#[derive(Debug, Clone)]
pub struct ExpectedSquares {
    /// Of trials about their conditions, by own coordinate.
    pub trial: DVector<f64>,
    /// Of conditions about the regression.
    pub condition: DVector<f64>,
    /// Of whitened residuals.
    pub residual: f64,
    /// Of a free law's coefficients, for a variance of one.
    pub law: f64,
    /// Number of trials.
    pub trials: usize,
    /// Number of conditions.
    pub conditions: usize,
    /// Number of residuals.
    pub values: usize,
}

impl ExpectedSquares {
    /// The spreads of largest marginal likelihood, given what is expected under the present ones (one step of expectation
    /// maximisation). Also the largest change of the logarithm of a variance.
    pub fn spreads(&self, law: Option<&FreeLawPrior>, present: &Spreads) -> (Spreads, f64) {
        let estimate = |sum: f64, count: usize| {
            (SPREAD_DEGREES * SPREAD_SD * SPREAD_SD + sum) / (SPREAD_DEGREES + count as f64)
        };
        let next = Spreads {
            trial: self.trial.map(|sum| estimate(sum, self.trials)),
            condition: self.condition.map(|sum| estimate(sum, self.conditions)),
            noise: (NOISE_WEIGHT + self.residual) / (NOISE_WEIGHT + self.values as f64),
            law: law.map_or(present.law, |law| {
                (LAW_WEIGHT * law.variance + self.law) / (LAW_WEIGHT + law.precision.nrows() as f64)
            }),
        };
        let change = |a: f64, b: f64| libm::log(a / b).abs();
        let of = |a: &DVector<f64>, b: &DVector<f64>| {
            a.iter().zip(b.iter()).map(|(a, b)| change(*a, *b)).fold(0.0, f64::max)
        };
        let largest = of(&next.trial, &present.trial)
            .max(of(&next.condition, &present.condition))
            .max(change(next.noise, present.noise))
            .max(change(next.law, present.law));
        (next, largest)
    }
}
