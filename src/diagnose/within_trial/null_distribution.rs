//! What screening finds where there is nothing: the fitted model simulated with fresh noise, refitted, screened again.

use nalgebra::DVector;
use rayon::prelude::*;

use super::lack_of_fit::pattern;
use super::residual_projection::{Direction, Tangent};
use super::score_test::{Probe, score};
use crate::diagnose::predicted_torque::torques;
use crate::fit::{Fit, NoiseSampler, Observations, SolverOptions, X_E, draw_observations, solve};
use crate::random::Stream;
use crate::statistics::gumbel_tail;

/// What screening makes of residuals.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finding {
    /// Largest score of any probe, in standard errors.
    pub largest: f64,
    /// The pattern's excess over what it is without one, in its own standard deviations.
    pub excess: f64,
    /// Variance of the residuals about their pattern over what the noise says.
    pub scatter: f64,
}

/// Screens `residuals`.
pub fn screen(
    prepared: &Observations,
    tangent: &Tangent,
    probes: &[Probe],
    residuals: &Direction,
) -> Finding {
    let pattern = pattern(prepared, tangent, residuals);
    let squares: f64 = residuals.iter().map(DVector::norm_squared).sum();
    let freedom = tangent.freedom() - pattern.count as f64;
    let scatter = (squares - pattern.squares) / freedom.max(1.0);
    let largest =
        probes.iter().map(|probe| score(probe, residuals, scatter.max(1.0)).abs()).fold(0.0, f64::max);
    let count = pattern.count.max(1) as f64;
    Finding { largest, excess: (pattern.statistic - count) / libm::sqrt(2.0 * count), scatter }
}

/// The session as it might have come out were `predicted` right: fresh noise of the torque, angles recorded again.
pub fn simulated(
    prepared: &Observations,
    predicted: &[Vec<f64>],
    noise: &NoiseSampler,
    stream: &mut Stream,
) -> Observations {
    let mut session = draw_observations(prepared, predicted, noise, stream);
    session.redraw_angle_error(stream);
    session
}

/// How probable findings at least as large are where the model is right.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Chance {
    /// Of the largest score of the whole catalogue.
    pub of_largest: f64,
    /// Of the pattern.
    pub of_excess: f64,
    /// Of the scatter about it.
    pub of_scatter: f64,
    /// That scatter, over what it is in the simulated sessions.
    pub scatter: f64,
}

/// Probability below which a misfit is one, over both levels. Stricter than the 5 % of false alarms that are allowed, since the
/// simulated sessions have Gaussian noise of exactly the measured covariance, and real ones do not.
pub const SIGNIFICANT: f64 = 0.01;

/// How many things are looked at: the largest score, the pattern, the scatter.
const LOOKS: f64 = 3.0;

impl Chance {
    /// Of anything.
    pub fn of_any(self) -> f64 {
        self.of_common().min(self.of_own())
    }

    /// Of what repetitions have in common, and so a mechanism can explain.
    pub fn of_common(self) -> f64 {
        (LOOKS * self.of_largest.min(self.of_excess)).min(1.0)
    }

    /// Of what each has of its own.
    pub fn of_own(self) -> f64 {
        (LOOKS * self.of_scatter).min(1.0)
    }
}

/// A scatter less than this many times that of the simulated sessions is none, however little these differ: no hold tells the
/// noise of a ramp to more than some fifth of its variance. Assumed.
const LEAST_SCATTER: f64 = 1.2;

/// How many sessions without any misfit are simulated.
pub const SIMULATIONS: usize = 60;

/// What comes out of sessions simulated with the fitted model as the truth.
pub struct Simulated {
    /// What screening makes of their residuals.
    findings: Vec<Finding>,
    /// Their trials' elastic limits, rad.
    pub limits: Vec<Vec<f64>>,
}

impl Simulated {
    pub fn new(prepared: &Observations, fit: &Fit, tangent: &Tangent, probes: &[Probe], seed: u64) -> Self {
        let predicted = torques(prepared, &fit.kinds, &fit.parameters);
        let noise = NoiseSampler::of(&prepared.noise_covariances);
        let (findings, limits) = (0..SIMULATIONS)
            .into_par_iter()
            .map(|number| {
                let mut stream = Stream::new(seed, &format!("bootstrap/{}/{number}", fit.kinds.len()));
                let simulated = simulated(prepared, &predicted, &noise, &mut stream);
                let refitted = refit(&simulated, fit);
                let residuals = Tangent::new(&simulated, &refitted).residuals();
                (screen(&simulated, tangent, probes, &residuals), elastic_limits(&refitted))
            })
            .unzip();
        Self { findings, limits }
    }

    /// How probable such a finding is in them.
    pub fn chance(&self, finding: &Finding) -> Chance {
        let all = |what: fn(&Finding) -> f64| self.findings.iter().map(what).collect::<Vec<_>>();
        let of = |what: fn(&Finding) -> f64| gumbel_tail(&all(what), what(finding));
        let usual = all(|finding| finding.scatter).iter().sum::<f64>() / SIMULATIONS as f64;
        let scatter = finding.scatter / usual;
        Chance {
            of_largest: of(|finding| finding.largest),
            of_excess: of(|finding| finding.excess),
            of_scatter: if scatter < LEAST_SCATTER { 1.0 } else { of(|finding| finding.scatter) },
            scatter,
        }
    }
}

/// The elastic limit of each trial, rad.
fn elastic_limits(fit: &Fit) -> Vec<f64> {
    fit.parameters.iter().map(|own| own[X_E]).collect()
}

/// A refit needs no more than this: it starts where the data came from.
const REFIT: SolverOptions = SolverOptions { max_iterations: 6, tolerance: 1e-3, max_log_step: 0.7 };

/// Fits the model of `fit` to other data, from where `fit` ended.
pub fn refit(prepared: &Observations, fit: &Fit) -> Fit {
    let start = &fit.solution.coordinates;
    let solution = solve(prepared, &fit.parameterisation, &fit.kinds, &fit.objective, start, REFIT);
    fit.at_solution(solution)
}
