//! Means, variances and covariances, gathered one subject at a time (Welford's recursion, which does not lose digits by cancellation).

use nalgebra::{DMatrix, DVector};

use super::distribution::{t_quantile, t_two_sided};

/// Squares below this fraction of the squared means are rounding errors.
pub(super) const ROUNDING_OF_SQUARES: f64 = 1e-24;

/// Count, mean and variance of a series.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct MeanVariance {
    count: usize,
    mean: f64,
    scatter: f64,
}

/// Count, mean vector and covariance matrix of vectors: one vector per subject, one element per cell of the design.
#[derive(Debug, Clone, PartialEq)]
pub struct MeanCovariance {
    count: usize,
    mean: DVector<f64>,
    scatter: DMatrix<f64>,
}

/// Estimate of a weighted sum of means, to be tested against zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contrast {
    /// The estimate, in the unit of the values.
    pub estimate: f64,
    /// Standard error of the estimate.
    pub se: f64,
    /// Degrees of freedom of the standard error.
    pub df: f64,
}

impl MeanVariance {
    /// Adds a value.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.scatter += before * (value - self.mean);
    }

    /// Number of values.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Mean of the values; 0 without any.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Unbiased variance of the values; `None` with fewer than two.
    pub fn variance(&self) -> Option<f64> {
        (self.count > 1).then(|| self.scatter / (self.count as f64 - 1.0))
    }

    /// Mean against zero; `None` with fewer than two values.
    pub fn contrast(&self) -> Option<Contrast> {
        let variance = self.variance()?;
        let n = self.count as f64;
        Some(Contrast { estimate: self.mean, se: (variance / n).sqrt(), df: n - 1.0 })
    }
}

impl FromIterator<f64> for MeanVariance {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut result = Self::default();
        for value in values {
            result.add(value);
        }
        result
    }
}

impl MeanCovariance {
    /// Starts without subjects; each will have `cells` values.
    pub fn new(cells: usize) -> Self {
        Self { count: 0, mean: DVector::zeros(cells), scatter: DMatrix::zeros(cells, cells) }
    }

    /// Gathers all `subjects`, each with `cells` values.
    pub fn of<'a>(cells: usize, subjects: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut result = Self::new(cells);
        for subject in subjects {
            result.add(subject);
        }
        result
    }

    /// Adds a subject.
    ///
    /// # Panics
    /// If the subject has another number of cells.
    pub fn add(&mut self, cells: &[f64]) {
        assert_eq!(cells.len(), self.mean.len(), "a subject has a value in each cell");
        self.count += 1;
        let before = DVector::from_column_slice(cells) - &self.mean;
        self.mean += &before / self.count as f64;
        let after = DVector::from_column_slice(cells) - &self.mean;
        self.scatter += &before * after.transpose();
    }

    /// Number of subjects.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Number of cells of each subject.
    pub fn cells(&self) -> usize {
        self.mean.len()
    }

    /// Mean of each cell over subjects.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// Covariance of the cells over subjects; `None` with fewer than two subjects.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        (self.count > 1).then(|| &self.scatter / (self.count as f64 - 1.0))
    }

    /// Mean over subjects of the sum of the cells weighted by `weights`; `None` with fewer than two subjects, and of cells that
    /// are equal in each subject: what is left of these is the rounding of the arithmetic.
    pub fn contrast(&self, weights: &[f64]) -> Option<Contrast> {
        let covariance = self.covariance()?;
        let weights = DVector::from_column_slice(weights);
        let variance = (weights.transpose() * covariance * &weights)[(0, 0)].max(0.0);
        let estimate = weights.dot(&self.mean);
        let rounding = ROUNDING_OF_SQUARES * weights.norm_squared() * self.mean.norm_squared();
        if estimate * estimate + variance <= rounding {
            return None;
        }
        Some(Contrast { estimate, se: (variance / self.count as f64).sqrt(), df: self.count as f64 - 1.0 })
    }
}

impl Contrast {
    /// Student's t: the estimate over its standard error.
    pub fn t(&self) -> f64 {
        self.estimate / self.se
    }

    /// Two-sided p-value of the hypothesis that the expected value is zero.
    pub fn p(&self) -> f64 {
        t_two_sided(self.t(), self.df)
    }

    /// 95 % confidence interval, lower and upper end.
    pub fn interval(&self) -> (f64, f64) {
        let half = t_quantile(0.975, self.df) * self.se;
        (self.estimate - half, self.estimate + half)
    }
}
