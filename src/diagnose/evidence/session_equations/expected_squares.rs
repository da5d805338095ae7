//! Expected sums of squares under the quadratic approximation of the posterior.

use nalgebra::{DMatrix, DVector};

use super::arrowhead::ArrowheadFactor;
use super::block_columns::{column_mut, subtract};
use super::design::{Design, Point};
use super::products::Products;
use super::quadratic::Quadratic;
use super::spreads::{ExpectedSquares, Spreads};

impl Quadratic {
    /// Expected sums of squares at the minimum. The quadratic is that of `design`, `spreads` and `products` at `point`.
    pub fn expected_squares(
        &self,
        design: &Design,
        spreads: &Spreads,
        point: &Point,
        products: &Products,
    ) -> ExpectedSquares {
        let minimum = point.moved(&self.step, 1.0);
        let covariance = self.factor.border_covariance();
        let variances = DeviationVariances::new(design, &self.factor, &covariance);
        let trials = design.conditions.iter().map(Vec::len).sum::<usize>();
        let mut expected = ExpectedSquares {
            trial: DVector::zeros(design.own),
            condition: DVector::zeros(design.own),
            residual: 0.0,
            law: 0.0,
            trials,
            conditions: design.conditions.len(),
            values: products.count(),
        };
        // The trace of the posterior's covariance times the data's part of its precision: the number of unknowns, less the same trace
        // with the priors' part. Times the variance of the noise, that is what uncertainty adds to the residuals' squares.
        let mut of_data = (design.own * (trials + design.conditions.len()) + covariance.nrows()) as f64
            - design.border_precision(spreads).dot(&covariance);
        for (condition, members) in design.conditions.iter().enumerate() {
            for k in 0..design.own {
                let mean = minimum.means[condition][k];
                for trial in members {
                    let off = minimum.own[*trial][k] - mean;
                    let variance = variances.of_trials[(k, *trial)];
                    expected.trial[k] += (off * off + variance) / design.variance_factor[*trial];
                    of_data -= variance * design.trial_precision(spreads, *trial, k);
                }
                let off = mean - design.expected(condition, &minimum.coefficients, k);
                let variance = variances.of_means[(k, condition)];
                expected.condition[k] += off * off + variance;
                of_data -= variance / spreads.condition[k];
            }
        }
        expected.residual = products.squares_after(&self.step) + spreads.noise * of_data;
        if let Some(law) = &design.law {
            let size = law.precision.nrows();
            let at = minimum.common.rows(law.first, size);
            expected.law = at.dot(&(&law.precision * at))
                + law.precision.dot(&covariance.view((law.first, law.first), (size, size)));
        }
        expected
    }
}

/// Variances of the deviations of trials from their conditions, and of conditions from the regression.
struct DeviationVariances {
    /// Own coordinates by trials.
    of_trials: DMatrix<f64>,
    /// Own coordinates by conditions.
    of_means: DMatrix<f64>,
}

impl DeviationVariances {
    /// Those of the posterior that has this `factor` and this `covariance` of the border.
    fn new(design: &Design, factor: &ArrowheadFactor, covariance: &DMatrix<f64>) -> Self {
        let size = design.own;
        let (trials, means) = (factor.trials.divided(), factor.means.divided());
        let mut of_trials = DMatrix::zeros(size, trials.count());
        let mut of_means = DMatrix::zeros(size, means.count());
        // How each deviation changes with the border's unknowns.
        let mut by_border = DMatrix::zeros(covariance.nrows(), size * (trials.count() + means.count()));
        for (condition, members) in design.conditions.iter().enumerate() {
            for k in 0..size {
                for trial in members {
                    let below = trials.below(*trial, k);
                    let by_mean = |other: usize| -below[other] - f64::from(u8::from(other == k));
                    of_trials[(k, *trial)] =
                        trials.own_variance(*trial, k) + means.variance_of(condition, by_mean);
                    let changes = column_mut(&mut by_border, size * trial + k);
                    subtract(changes, 1.0, &below[size..]);
                    for other in 0..size {
                        subtract(changes, by_mean(other), means.below(condition, other));
                    }
                }
                of_means[(k, condition)] = means.own_variance(condition, k);
                let changes = column_mut(&mut by_border, size * (trials.count() + condition) + k);
                subtract(changes, 1.0, means.below(condition, k));
                for (a, regressor) in design.regressors[condition].iter().enumerate() {
                    changes[design.common_mean.len() + a * size + k] -= regressor;
                }
            }
        }
        let spread = covariance * &by_border;
        let variances = of_trials.iter_mut().chain(of_means.iter_mut());
        for (place, variance) in variances.enumerate() {
            *variance += spread.column(place).dot(&by_border.column(place));
        }
        Self { of_trials, of_means }
    }
}
