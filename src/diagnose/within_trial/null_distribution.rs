//! Null distribution of the misfit statistics: residuals of noise alone, less what the free parameters absorb.

use nalgebra::DVector;
use rayon::prelude::*;

use super::lack_of_fit::pattern;
use super::residual_projection::{ResidualProjection, WhitenedTrials};
use super::score_test::{Probe, score};
use crate::diagnose::evidence::angle_error::AngleErrors;
use crate::diagnose::evidence::size_drift::ConstantDrifts;
use crate::fit::{Observations, precision_factors};
use crate::random::Stream;

/// Misfit statistics of the residuals of a fit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MisfitStatistics {
    /// Largest absolute score of any mechanism, in standard errors.
    pub largest: f64,
    /// Excess of the lack-of-fit statistic over its expected value, in standard deviations.
    pub excess: f64,
    /// Ratio of the variance of the residuals about their pattern to that of the noise.
    pub scatter: f64,
}

impl MisfitStatistics {
    /// Whether all of them are numbers.
    pub fn is_finite(&self) -> bool {
        [self.largest, self.excess, self.scatter].iter().all(|own| own.is_finite())
    }
}

/// Computes the misfit statistics of `residuals`.
///
/// Scores are of known directions, so that the angle's errors are part of their noise. The pattern is of any shape: what the angle's errors
/// add to it is in its null distribution alone, since their own shape is not known as well as that.
pub fn misfit_statistics(
    observations: &Observations,
    tangent: &ResidualProjection,
    probes: &[Probe],
    residuals: &WhitenedTrials,
) -> MisfitStatistics {
    let pattern = pattern(observations, tangent, residuals);
    let squares: f64 = residuals.iter().map(DVector::norm_squared).sum();
    let freedom = tangent.freedom() - pattern.count as f64;
    let scatter = (squares - pattern.squares) / freedom.max(1.0);
    let whitened = tangent.whitened(residuals.clone());
    let largest = probes.iter().map(|probe| score(probe, &whitened, scatter).abs()).fold(0.0, f64::max);
    let count = pattern.count.max(1) as f64;
    MisfitStatistics { largest, excess: (pattern.statistic - count) / libm::sqrt(2.0 * count), scatter }
}

/// P-values of the misfit statistics: probabilities of values at least as large if the model is right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct MisfitPValues {
    /// p-value of the largest score.
    pub of_largest: f64,
    /// p-value of the pattern.
    pub of_excess: f64,
    /// p-value of the variance about the pattern.
    pub of_scatter: f64,
    /// The variance about the pattern, relative to its mean in noise alone.
    pub scatter: f64,
}

/// Significance level of the tests for misfit, within and across trials. Stricter than the allowed 5 % of false alarms, since drawn noise
/// is Gaussian and of exactly the measured covariance, and real noise is not.
pub const MISFIT_LEVEL: f64 = 0.01;

/// Number of statistics tested (largest score, pattern, variance): the factor of the Bonferroni correction.
const TESTED_STATISTICS: f64 = 3.0;

impl MisfitPValues {
    /// p-value of any misfit.
    pub fn any(self) -> f64 {
        let smallest = self.of_largest.min(self.of_excess).min(self.of_scatter);
        (TESTED_STATISTICS * smallest).min(1.0)
    }

    /// Whether they are numbers.
    pub fn is_finite(self) -> bool {
        [self.of_largest, self.of_excess, self.of_scatter, self.scatter].iter().all(|own| own.is_finite())
    }

    /// p-value of misfit that differs between repetitions.
    pub fn between_repetitions(self) -> f64 {
        (TESTED_STATISTICS * self.of_scatter).min(1.0)
    }
}

/// Relative standard deviation with which the holds predict the variance of the noise in the ramp. Assumed.
const HOLD_PREDICTION_SD: f64 = 0.1;

/// Number of draws of the null distribution: with it a p-value of 0.0005 is the smallest, a sixth of a twentieth of
/// [`MISFIT_LEVEL`].
const NOISE_DRAWS: usize = 1999;

/// Misfit statistics of noise alone.
pub struct NullDistribution {
    findings: Vec<MisfitStatistics>,
}

impl NullDistribution {
    /// Draws noise of the measured covariance for every trial, and the drifts of measured constants and the errors of the angle that trials
    /// share, and takes out what the free parameters of `tangent` absorb.
    pub fn new(
        observations: &Observations,
        tangent: &ResidualProjection,
        (constant_drifts, angle_errors): (&ConstantDrifts, &AngleErrors),
        probes: &[Probe],
        seed: u64,
    ) -> Self {
        let sds: Vec<f64> = precision_factors(observations).iter().map(|own| libm::sqrt(*own)).collect();
        let findings = (0..NOISE_DRAWS)
            .into_par_iter()
            .map(|number| {
                let mut stream = Stream::new(seed, &format!("noise alone/{number}"));
                let mut drawn = |variances: &DVector<f64>| {
                    variances.map(|variance| libm::sqrt(variance) * stream.normal())
                };
                let (errors, drifts) = (drawn(&angle_errors.variances), drawn(&constant_drifts.variances));
                let noise = |trial: usize| {
                    let sd = observations.noise_index[trial].map_or(1.0, |index| sds[index]);
                    DVector::from_fn(tangent.torque_values(trial), |_, _| sd * stream.normal())
                        + &angle_errors.columns[trial] * &errors
                        + &constant_drifts.columns[trial] * &drifts
                };
                let noise: WhitenedTrials = (0..observations.trials.len()).map(noise).collect();
                let mut finding = misfit_statistics(observations, tangent, probes, &tangent.project(&noise));
                finding.scatter *= libm::exp(HOLD_PREDICTION_SD * stream.normal());
                finding
            })
            .collect();
        Self { findings }
    }

    /// P-values of `finding` under the null distribution; no numbers where `finding` or a draw is none. A model that diverges under the
    /// errors of the angle has no null distribution.
    pub fn p_values(&self, finding: &MisfitStatistics) -> MisfitPValues {
        if !finding.is_finite() || !self.findings.iter().all(MisfitStatistics::is_finite) {
            let none = f64::NAN;
            return MisfitPValues { of_largest: none, of_excess: none, of_scatter: none, scatter: none };
        }
        let count = self.findings.len() as f64;
        let of = |what: fn(&MisfitStatistics) -> f64| {
            let reached = self.findings.iter().filter(|own| what(own) >= what(finding)).count();
            (reached + 1) as f64 / (count + 1.0)
        };
        let usual = self.findings.iter().map(|finding| finding.scatter).sum::<f64>() / count;
        MisfitPValues {
            of_largest: of(|finding| finding.largest),
            of_excess: of(|finding| finding.excess),
            of_scatter: of(|finding| finding.scatter),
            scatter: finding.scatter / usual,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn finding(scatter: f64) -> MisfitStatistics {
        MisfitStatistics { largest: scatter, excess: scatter, scatter }
    }

    #[test]
    fn a_null_distribution_that_is_no_number_makes_nothing_significant() {
        let findings = (0..99).map(|draw| finding(f64::from(draw))).collect::<Vec<_>>();
        let sound = NullDistribution { findings: findings.clone() }.p_values(&finding(1e6));
        assert_eq!(sound.of_largest, 0.01);
        assert!(sound.is_finite());
        let diverged = NullDistribution { findings: [&findings[1..], &[finding(f64::NAN)]].concat() };
        assert!(!diverged.p_values(&finding(1e6)).is_finite());
        assert!(!NullDistribution { findings }.p_values(&finding(f64::NAN)).is_finite());
    }
}
