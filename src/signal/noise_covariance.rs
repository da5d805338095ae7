//! Covariance of noise in an analysis window, estimated from stretches of pure noise.
//!
//! The noise of filtered torque is not white: some 4 to 5 independent values remain in 100 samples, and the torque of a subject
//! drifts and trembles. Stretches of noise therefore pass the same processing as the window (filter, subtraction of the mean before,
//! cut), and their covariance describes the noise of the window.

use nalgebra::DMatrix;

/// Covariance of the noise in an analysis window.
#[derive(Debug, Clone)]
pub struct NoiseCovariance {
    /// Covariance between the noise samples of the window, (N m)^2.
    pub covariance: DMatrix<f64>,
    /// Number of stretches from which the covariance was estimated; neighbouring stretches overlap.
    pub stretches: usize,
}

impl NoiseCovariance {
    /// Estimates the covariance from `stretches`, each with the noise samples of one window, N m; `None` for fewer than two stretches.
    pub fn estimate(stretches: &[Vec<f64>]) -> Option<Self> {
        let samples = stretches.first()?.len();
        if stretches.len() < 2 {
            return None;
        }
        let data = DMatrix::from_fn(samples, stretches.len(), |row, column| stretches[column][row]);
        // The expected value is zero: during a hold the torque rises as often as it falls.
        let covariance = &data * data.transpose() / stretches.len() as f64;
        Some(Self { covariance, stretches: stretches.len() })
    }

    /// The covariance of the first `samples` noise samples alone.
    pub fn of_first(&self, samples: usize) -> Self {
        let covariance = self.covariance.view((0, 0), (samples, samples)).into_owned();
        Self { covariance, stretches: self.stretches }
    }

    /// Standard deviation of the last sample of the window, N m.
    pub fn last_sample_sd_nm(&self) -> f64 {
        let last = self.covariance.nrows() - 1;
        libm::sqrt(self.covariance[(last, last)])
    }

    /// Number of independent directions with a variance above `floor`, (N m)^2.
    pub fn directions(&self, floor: f64) -> usize {
        self.covariance.clone().symmetric_eigenvalues().iter().filter(|value| **value > floor).count()
    }

    /// Whitening matrix: it maps the noise samples of a window to independent values of variance one.
    ///
    /// Directions with a variance below `floor`, (N m)^2, are dropped: the covariance of filtered noise is numerically singular,
    /// and the inverse of its smallest eigenvalues would weight rounding and model error.
    pub fn whitener(&self, floor: f64) -> DMatrix<f64> {
        let eigen = self.covariance.clone().symmetric_eigen();
        let mut kept: Vec<usize> =
            (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > floor).collect();
        kept.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        DMatrix::from_fn(kept.len(), self.covariance.nrows(), |row, column| {
            eigen.eigenvectors[(column, kept[row])] / libm::sqrt(eigen.eigenvalues[kept[row]])
        })
    }

    /// Number of independent values in the window: trace^2 / trace of the square.
    pub fn effective_samples(&self) -> f64 {
        let trace = self.covariance.trace();
        trace * trace / self.covariance.norm_squared()
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::DVector;

    use super::*;
    use crate::random::Stream;
    use crate::signal::{FilterSpec, filter};

    fn filtered_stretches(count: usize) -> Vec<Vec<f64>> {
        let sections = FilterSpec::PAPER.sections(2500.0).unwrap();
        let mut stream = Stream::new(11, "noise");
        let raw: Vec<f64> = (0..count * 200 + 400).map(|_| 0.02 * stream.normal()).collect();
        let smooth = filter(&sections, &raw);
        (0..count).map(|i| smooth[400 + i * 200..500 + i * 200].to_vec()).collect()
    }

    #[test]
    fn white_noise_through_the_papers_filter_leaves_four_to_five_independent_values() {
        let noise = NoiseCovariance::estimate(&filtered_stretches(3000)).unwrap();
        let effective = noise.effective_samples();
        assert!((3.5..5.5).contains(&effective), "{effective}");
    }

    #[test]
    fn the_whitener_makes_fresh_noise_white() {
        let stretches = filtered_stretches(4000);
        let whitener = NoiseCovariance::estimate(&stretches[..2000]).unwrap().whitener(1e-9);
        let fresh: Vec<DVector<f64>> =
            stretches[2000..].iter().map(|s| &whitener * DVector::from_column_slice(s)).collect();
        for component in 0..8 {
            let variance = fresh.iter().map(|z| z[component] * z[component]).sum::<f64>() / 2000.0;
            assert!((variance - 1.0).abs() < 0.15, "component {component}: {variance}");
        }
    }

    #[test]
    fn noise_needs_at_least_two_stretches() {
        assert!(NoiseCovariance::estimate(&[]).is_none());
        assert!(NoiseCovariance::estimate(&filtered_stretches(1)).is_none());
    }
}
