//! Null distribution of the misfit statistics by parametric bootstrap: the fitted model is simulated with new noise, refitted and
//! tested again.

use nalgebra::DVector;
use rayon::prelude::*;

use super::lack_of_fit::pattern;
use super::residual_projection::{ResidualProjection, WhitenedTrials};
use super::score_test::{Probe, score};
use crate::diagnose::predicted_torque::torques;
use crate::fit::{Fit, NoiseSampler, Observations, SolverOptions, X_E, draw_observations, solve};
use crate::random::Stream;
use crate::statistics::gumbel_tail;

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
    let largest =
        probes.iter().map(|probe| score(probe, residuals, scatter.max(1.0)).abs()).fold(0.0, f64::max);
    let count = pattern.count.max(1) as f64;
    MisfitStatistics { largest, excess: (pattern.statistic - count) / libm::sqrt(2.0 * count), scatter }
}

/// A simulated session with the torques `predicted`, new noise, and newly recorded angles.
pub fn simulated(
    observations: &Observations,
    predicted: &[Vec<f64>],
    noise: &NoiseSampler,
    stream: &mut Stream,
) -> Observations {
    let mut session = draw_observations(observations, predicted, noise, stream);
    session.redraw_angle_error(stream);
    session
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
    /// The variance about the pattern, relative to its mean in the simulated sessions.
    pub scatter: f64,
}

/// Significance level of the tests for misfit, within and across trials. Stricter than the allowed 5 % of false alarms, since the
/// simulated sessions have Gaussian noise of exactly the measured covariance and real sessions do not.
pub const MISFIT_LEVEL: f64 = 0.01;

/// Number of statistics tested (largest score, pattern, variance): the factor of the Bonferroni correction.
const TESTED_STATISTICS: f64 = 3.0;

impl MisfitPValues {
    /// p-value of any misfit.
    pub fn any(self) -> f64 {
        self.common().min(self.between_repetitions())
    }

    /// p-value of misfit that repetitions have in common, which a mechanism can explain.
    pub fn common(self) -> f64 {
        (TESTED_STATISTICS * self.of_largest.min(self.of_excess)).min(1.0)
    }

    /// p-value of misfit that differs between repetitions.
    pub fn between_repetitions(self) -> f64 {
        (TESTED_STATISTICS * self.of_scatter).min(1.0)
    }
}

/// Smallest ratio of the residual variance to that of the simulated sessions that counts as excess variance: the hold predicts the
/// variance of the noise on the ramp to about a fifth. Assumed.
const MIN_EXCESS_VARIANCE_RATIO: f64 = 1.2;

/// Number of simulated sessions of the null distribution.
pub const NULL_SIMULATIONS: usize = 60;

/// Sessions simulated with the fitted model as the truth.
pub struct NullDistribution {
    /// Misfit statistics of each session.
    findings: Vec<MisfitStatistics>,
    /// Fitted elastic limit of each trial in each session, rad.
    pub limits: Vec<Vec<f64>>,
}

impl NullDistribution {
    pub fn new(
        observations: &Observations,
        fit: &Fit,
        tangent: &ResidualProjection,
        probes: &[Probe],
        seed: u64,
    ) -> Self {
        let predicted = torques(observations, &fit.kinds, &fit.parameters);
        let noise = NoiseSampler::new(&observations.noise_covariances);
        let (findings, limits) = (0..NULL_SIMULATIONS)
            .into_par_iter()
            .map(|number| {
                let mut stream = Stream::new(seed, &format!("bootstrap/{}/{number}", fit.kinds.len()));
                let simulated = simulated(observations, &predicted, &noise, &mut stream);
                let refitted = refit(&simulated, fit);
                let residuals = ResidualProjection::new(&simulated, &refitted).residuals();
                (misfit_statistics(&simulated, tangent, probes, &residuals), elastic_limits(&refitted))
            })
            .unzip();
        Self { findings, limits }
    }

    /// P-values of `finding` under the null distribution.
    pub fn p_values(&self, finding: &MisfitStatistics) -> MisfitPValues {
        let all = |what: fn(&MisfitStatistics) -> f64| self.findings.iter().map(what).collect::<Vec<_>>();
        let of = |what: fn(&MisfitStatistics) -> f64| gumbel_tail(&all(what), what(finding));
        let usual = all(|finding| finding.scatter).iter().sum::<f64>() / NULL_SIMULATIONS as f64;
        let scatter = finding.scatter / usual;
        MisfitPValues {
            of_largest: of(|finding| finding.largest),
            of_excess: of(|finding| finding.excess),
            of_scatter: if scatter < MIN_EXCESS_VARIANCE_RATIO { 1.0 } else { of(|finding| finding.scatter) },
            scatter,
        }
    }
}

/// The elastic limit of each trial, rad.
fn elastic_limits(fit: &Fit) -> Vec<f64> {
    fit.parameters.iter().map(|own| own[X_E]).collect()
}

/// Solver options of the refits, which start at the simulated truth.
const REFIT_OPTIONS: SolverOptions = SolverOptions { max_iterations: 6, tolerance: 1e-3, max_log_step: 0.7 };

/// Fits the model of `fit` to other data, starting at the optimum of `fit`.
pub fn refit(observations: &Observations, fit: &Fit) -> Fit {
    let start = &fit.solution.coordinates;
    let solution =
        solve(observations, &fit.parameterisation, &fit.kinds, &fit.objective, start, REFIT_OPTIONS);
    fit.at_solution(solution)
}
