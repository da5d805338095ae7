//! What does not change while a model is fitted, and the cost of values of the unknowns.

use nalgebra::{DMatrix, DVector};

use super::spreads::{FreeLawPrior, Spreads};
use crate::diagnose::evidence::gaussian::log_determinant;
use crate::fit::{EXPONENT_SD, LEVEL_SD};

/// Number of regressors of a condition: 1, log velocity and log torque.
pub const REGRESSORS: usize = 3;

/// What does not change while a model is fitted.
#[derive(Debug, Clone)]
pub struct Design {
    /// For each condition, its trials.
    pub conditions: Vec<Vec<usize>>,
    /// For each condition, its regressors.
    pub regressors: Vec<[f64; REGRESSORS]>,
    /// Number of own coordinates of a trial.
    pub own: usize,
    /// Priors of the common coordinates: mean and precision matrix.
    pub common_mean: DVector<f64>,
    /// Precision of the common coordinates, but for those of a free law.
    pub common_precision: DMatrix<f64>,
    /// Normal prior of the difference of two own coordinates at mean velocity and torque: the coordinates, mean, standard deviation.
    pub ratio: Option<(usize, usize, f64, f64)>,
    /// The coefficients of a free law.
    pub law: Option<FreeLawPrior>,
    /// Factor of the prior variance of a trial about its condition: 1, or much more for a trial that does not belong.
    pub variance_factor: Vec<f64>,
}

/// Values of the unknowns.
#[derive(Debug, Clone)]
pub struct Point {
    /// Own coordinates of each trial.
    pub own: Vec<DVector<f64>>,
    /// Mean of each condition.
    pub means: Vec<DVector<f64>>,
    /// Coefficients of the regression: for each regressor one value by own coordinate.
    pub coefficients: DVector<f64>,
    /// Common coordinates.
    pub common: DVector<f64>,
}

impl Point {
    /// Moved by `part` of `step`.
    pub fn moved(&self, step: &Self, part: f64) -> Self {
        let add = |values: &[DVector<f64>], steps: &[DVector<f64>]| {
            values.iter().zip(steps).map(|(value, step)| value + step * part).collect()
        };
        Self {
            own: add(&self.own, &step.own),
            means: add(&self.means, &step.means),
            coefficients: &self.coefficients + &step.coefficients * part,
            common: &self.common + &step.common * part,
        }
    }
}

/// The cost at `point`, where the session has the sum of squares `squares` in `count` values.
pub fn cost(design: &Design, spreads: &Spreads, point: &Point, squares: f64, count: usize) -> f64 {
    let mut cost = 0.5 * squares / spreads.noise + 0.5 * count as f64 * libm::log(spreads.noise);
    for (condition, trials) in design.conditions.iter().enumerate() {
        for k in 0..design.own {
            let mean = point.means[condition][k];
            for trial in trials {
                let off = point.own[*trial][k] - mean;
                cost += 0.5 * off * off * design.trial_precision(spreads, *trial, k);
            }
            let off = mean - design.expected(condition, &point.coefficients, k);
            cost += 0.5 * off * off / spreads.condition[k];
        }
    }
    for (index, coefficient) in point.coefficients.iter().enumerate() {
        let off = coefficient / design.prior_sd(index);
        cost += 0.5 * off * off;
    }
    if let Some((above, below, mean, sd)) = design.ratio {
        let off = (point.coefficients[above] - point.coefficients[below] - mean) / sd;
        cost += 0.5 * off * off;
    }
    let off = &point.common - &design.common_mean;
    cost += 0.5 * off.dot(&(design.precision(spreads) * &off));
    cost + spreads.negative_log_prior(design.law.as_ref())
}

impl Design {
    /// The regression's value for own coordinate `k` in a condition.
    #[inline]
    pub(super) fn expected(&self, condition: usize, coefficients: &DVector<f64>, k: usize) -> f64 {
        let regressors = self.regressors[condition].iter().enumerate();
        regressors.map(|(a, regressor)| regressor * coefficients[a * self.own + k]).sum()
    }

    /// Precision of own coordinate `k` of a trial about its condition.
    #[inline]
    pub(super) fn trial_precision(&self, spreads: &Spreads, trial: usize, k: usize) -> f64 {
        1.0 / (spreads.trial[k] * self.variance_factor[trial])
    }

    /// Precision, in the prior, of common coordinates and then of coefficients.
    pub(super) fn border_precision(&self, spreads: &Spreads) -> DMatrix<f64> {
        let (common, coefficients) = (self.common_mean.len(), REGRESSORS * self.own);
        let mut precision = self.precision(spreads).resize(common + coefficients, common + coefficients, 0.0);
        for index in 0..coefficients {
            precision[(common + index, common + index)] = 1.0 / (self.prior_sd(index) * self.prior_sd(index));
        }
        if let Some((above, below, _, sd)) = self.ratio {
            for (one, sign) in [(above, 1.0), (below, -1.0)] {
                precision[(common + one, common + above)] += sign / (sd * sd);
                precision[(common + one, common + below)] -= sign / (sd * sd);
            }
        }
        precision
    }

    /// Standard deviation, in the prior, of a coefficient of the regression.
    fn prior_sd(&self, coefficient: usize) -> f64 {
        if coefficient < self.own { LEVEL_SD } else { EXPONENT_SD }
    }

    /// Precision of the common coordinates.
    pub(super) fn precision(&self, spreads: &Spreads) -> DMatrix<f64> {
        let mut precision = self.common_precision.clone();
        if let Some(law) = &self.law {
            let size = law.precision.nrows();
            let mut own = precision.view_mut((law.first, law.first), (size, size));
            own += &law.precision / spreads.law;
        }
        precision
    }

    /// Half the logarithm of the determinant of the prior's precision.
    pub(super) fn half_log_precision(&self, spreads: &Spreads, fixed: f64) -> f64 {
        let trials: usize = self.conditions.iter().map(Vec::len).sum();
        let log_sum = |variances: &DVector<f64>| variances.iter().map(|own| libm::log(*own)).sum::<f64>();
        let mut twice = fixed - trials as f64 * log_sum(&spreads.trial);
        let factors: f64 = self.variance_factor.iter().map(|own| libm::log(*own)).sum();
        twice -= self.own as f64 * factors;
        twice -= self.conditions.len() as f64 * log_sum(&spreads.condition);
        twice -=
            2.0 * self.own as f64 * (libm::log(LEVEL_SD) + (REGRESSORS - 1) as f64 * libm::log(EXPONENT_SD));
        if let Some(law) = &self.law {
            twice += law.log_determinant - law.precision.nrows() as f64 * libm::log(spreads.law);
        }
        0.5 * twice
    }

    /// The same without the prior of a ratio, which is about values and not about errors.
    pub fn without_ratio(&self) -> Self {
        Self { ratio: None, ..self.clone() }
    }

    /// The same where the common coordinates at `places` are known to be where they are at `point`.
    pub fn holding(&self, places: &[usize], point: &Point) -> Self {
        /// Precision of a coordinate that is known, far above what any data tell.
        const KNOWN: f64 = 1e14;
        let mut held = self.clone();
        for place in places {
            held.common_mean[*place] = point.common[*place];
            held.common_precision[(*place, *place)] += KNOWN;
        }
        held
    }

    /// Logarithm of the determinant of the common coordinates' precision, but for those of a free law.
    pub fn log_common_precision(&self) -> Option<f64> {
        let skip = self.law.as_ref().map(|law| law.first..law.first + law.precision.nrows());
        let kept: Vec<usize> = (0..self.common_mean.len())
            .filter(|place| skip.as_ref().is_none_or(|skip| !skip.contains(place)))
            .collect();
        let matrix =
            DMatrix::from_fn(kept.len(), kept.len(), |i, j| self.common_precision[(kept[i], kept[j])]);
        log_determinant(matrix)
    }
}
