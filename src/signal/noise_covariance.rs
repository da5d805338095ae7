//! The noise that a fit must be judged against, measured in the holds before the ramps.
//!
//! What is left of a trial's torque after the filter is not white: some 4 to 5 independent values remain in 100 samples,
//! and a person wanders and trembles besides. So stretches of the hold go through exactly what the ramp goes through
//! (filter, level before, window), and their covariance is the noise.

use nalgebra::DMatrix;

/// Covariance of the noise in the analysed window.
#[derive(Debug, Clone)]
pub struct NoiseCovariance {
    /// Covariance of the samples of the window, (N m)^2.
    pub covariance: DMatrix<f64>,
    /// How many stretches of hold it was measured on; neighbours overlap.
    pub stretches: usize,
}

impl NoiseCovariance {
    /// Measures the covariance on `stretches`: torque over a window, less the level before it, some samples of it.
    ///
    /// `None` if there are fewer than two.
    pub fn measure(stretches: &[Vec<f64>]) -> Option<Self> {
        let samples = stretches.first()?.len();
        if stretches.len() < 2 {
            return None;
        }
        let data = DMatrix::from_fn(samples, stretches.len(), |row, column| stretches[column][row]);
        // The mean is zero by nature of a hold: the wrist goes up as often as down.
        let covariance = &data * data.transpose() / stretches.len() as f64;
        Some(Self { covariance, stretches: stretches.len() })
    }

    /// Standard deviation of the window's last sample, N m.
    pub fn last_sample_sd_nm(&self) -> f64 {
        let last = self.covariance.nrows() - 1;
        libm::sqrt(self.covariance[(last, last)])
    }

    /// How many independent directions have a variance above `floor`, (N m)^2.
    pub fn directions(&self, floor: f64) -> usize {
        self.covariance.clone().symmetric_eigenvalues().iter().filter(|value| **value > floor).count()
    }

    /// The matrix that turns a window into independent values of variance one.
    ///
    /// Directions of the covariance with a variance below `floor` (N m)^2 are left out: the filtered noise's covariance is
    /// numerically singular, and an inverse that trusted its smallest values would weigh rounding and model error.
    pub fn whitener(&self, floor: f64) -> DMatrix<f64> {
        let eigen = self.covariance.clone().symmetric_eigen();
        let mut kept: Vec<usize> =
            (0..eigen.eigenvalues.len()).filter(|i| eigen.eigenvalues[*i] > floor).collect();
        kept.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
        DMatrix::from_fn(kept.len(), self.covariance.nrows(), |row, column| {
            eigen.eigenvectors[(column, kept[row])] / libm::sqrt(eigen.eigenvalues[kept[row]])
        })
    }

    /// How many independent values the window holds: (trace)^2 / trace of the square.
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
        let noise = NoiseCovariance::measure(&filtered_stretches(3000)).unwrap();
        let effective = noise.effective_samples();
        assert!((3.5..5.5).contains(&effective), "{effective}");
    }

    #[test]
    fn the_whitener_makes_fresh_noise_white() {
        let stretches = filtered_stretches(4000);
        let whitener = NoiseCovariance::measure(&stretches[..2000]).unwrap().whitener(1e-9);
        let fresh: Vec<DVector<f64>> =
            stretches[2000..].iter().map(|s| &whitener * DVector::from_column_slice(s)).collect();
        for component in 0..8 {
            let variance = fresh.iter().map(|z| z[component] * z[component]).sum::<f64>() / 2000.0;
            assert!((variance - 1.0).abs() < 0.15, "component {component}: {variance}");
        }
    }

    #[test]
    fn noise_needs_at_least_two_stretches() {
        assert!(NoiseCovariance::measure(&[]).is_none());
        assert!(NoiseCovariance::measure(&filtered_stretches(1)).is_none());
    }
}
