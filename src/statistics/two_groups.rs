//! Two groups of persons.

use super::moments::Contrast;

/// A group's values, one a person, gathered one at a time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Sample {
    count: usize,
    mean: f64,
    scatter: f64,
}

impl Sample {
    /// Adds a person.
    pub fn add(&mut self, value: f64) {
        self.count += 1;
        let before = value - self.mean;
        self.mean += before / self.count as f64;
        self.scatter += before * (value - self.mean);
    }

    /// How many persons.
    pub fn count(&self) -> usize {
        self.count
    }

    /// Their mean.
    pub fn mean(&self) -> f64 {
        self.mean
    }

    /// Their variance; `None` with fewer than two.
    pub fn variance(&self) -> Option<f64> {
        (self.count > 1).then(|| self.scatter / (self.count as f64 - 1.0))
    }

    /// Mean against zero.
    pub fn contrast(&self) -> Option<Contrast> {
        let variance = self.variance()?;
        let n = self.count as f64;
        Some(Contrast { estimate: self.mean, se: (variance / n).sqrt(), df: n - 1.0 })
    }
}

impl FromIterator<f64> for Sample {
    fn from_iter<I: IntoIterator<Item = f64>>(values: I) -> Self {
        let mut sample = Self::default();
        for value in values {
            sample.add(value);
        }
        sample
    }
}

/// The difference between two groups' means (Welch 1947: their variances may differ).
pub fn welch(a: &Sample, b: &Sample) -> Option<Contrast> {
    let (va, vb) = (a.variance()? / a.count as f64, b.variance()? / b.count as f64);
    let df = (va + vb) * (va + vb) / (va * va / (a.count as f64 - 1.0) + vb * vb / (b.count as f64 - 1.0));
    Some(Contrast { estimate: a.mean - b.mean, se: (va + vb).sqrt(), df })
}
