//! Comparison of two groups.

use super::moments::{Contrast, MeanVariance};

/// Difference of two groups' means, a less b (Welch 1947: the groups' variances may differ). `None` if a group has fewer than two
/// values.
pub fn welch(a: &MeanVariance, b: &MeanVariance) -> Option<Contrast> {
    let (count_a, count_b) = (a.count() as f64, b.count() as f64);
    let (va, vb) = (a.variance()? / count_a, b.variance()? / count_b);
    let df = (va + vb) * (va + vb) / (va * va / (count_a - 1.0) + vb * vb / (count_b - 1.0));
    Some(Contrast { estimate: a.mean() - b.mean(), se: (va + vb).sqrt(), df })
}
