//! Means and covariances of a person's cells over persons, gathered one person at a time.

use nalgebra::{DMatrix, DVector};

use super::distribution::{t_quantile, t_two_sided};

/// Count, means and covariances so far (Welford's recursion, which does not cancel).
#[derive(Debug, Clone, PartialEq)]
pub struct Moments {
    count: usize,
    mean: DVector<f64>,
    scatter: DMatrix<f64>,
}

/// A weighted sum of cells over persons, against zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Contrast {
    /// Its mean.
    pub estimate: f64,
    /// Standard error of the mean.
    pub se: f64,
    /// Degrees of freedom.
    pub df: f64,
}

impl Moments {
    /// Of persons with so many cells; nobody yet.
    pub fn new(cells: usize) -> Self {
        Self { count: 0, mean: DVector::zeros(cells), scatter: DMatrix::zeros(cells, cells) }
    }

    /// Of all `persons`, each with the same number of cells.
    pub fn of<'a>(cells: usize, persons: impl IntoIterator<Item = &'a [f64]>) -> Self {
        let mut moments = Self::new(cells);
        for person in persons {
            moments.add(person);
        }
        moments
    }

    /// Adds a person.
    ///
    /// # Panics
    /// If the number of cells is another.
    pub fn add(&mut self, cells: &[f64]) {
        assert_eq!(cells.len(), self.mean.len(), "a person has a value in each cell");
        self.count += 1;
        let before = DVector::from_column_slice(cells) - &self.mean;
        self.mean += &before / self.count as f64;
        let after = DVector::from_column_slice(cells) - &self.mean;
        self.scatter += &before * after.transpose();
    }

    /// How many persons.
    pub fn count(&self) -> usize {
        self.count
    }

    /// How many cells a person has.
    pub fn cells(&self) -> usize {
        self.mean.len()
    }

    /// Mean of each cell.
    pub fn mean(&self) -> &DVector<f64> {
        &self.mean
    }

    /// Covariance of the cells over persons; `None` with fewer than two.
    pub fn covariance(&self) -> Option<DMatrix<f64>> {
        (self.count > 1).then(|| &self.scatter / (self.count as f64 - 1.0))
    }

    /// Standard deviation of a cell over persons.
    pub fn sd(&self, cell: usize) -> Option<f64> {
        (self.count > 1).then(|| (self.scatter[(cell, cell)] / (self.count as f64 - 1.0)).max(0.0).sqrt())
    }

    /// The sum of the cells weighted by `weights`; `None` with fewer than two persons.
    pub fn contrast(&self, weights: &[f64]) -> Option<Contrast> {
        let covariance = self.covariance()?;
        let weights = DVector::from_column_slice(weights);
        let variance = (weights.transpose() * covariance * &weights)[(0, 0)].max(0.0);
        Some(Contrast {
            estimate: weights.dot(&self.mean),
            se: (variance / self.count as f64).sqrt(),
            df: self.count as f64 - 1.0,
        })
    }
}

impl Contrast {
    /// Student's t.
    pub fn t(&self) -> f64 {
        self.estimate / self.se
    }

    /// Two-sided p-value.
    pub fn p(&self) -> f64 {
        t_two_sided(self.t(), self.df)
    }

    /// 95 % confidence interval.
    pub fn interval(&self) -> (f64, f64) {
        let half = t_quantile(0.975, self.df) * self.se;
        (self.estimate - half, self.estimate + half)
    }
}
