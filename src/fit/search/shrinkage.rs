//! Empirical-Bayes shrinkage: k_dec and x_e of single trials, where their own data hardly determine them, are drawn towards a
//! regression over all trials.

use nalgebra::{Matrix3, Vector3};

use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::predictions;
use crate::fit::fitted::uncertainty::uncertainties;
use crate::fit::parameters::parameterisation::SHRINKAGE_SDS;
use crate::fit::parameters::starting_values::StartingValues;

/// Largest number of repetitions of the shrinkage, each with the target from the fit before.
const MAX_REPETITIONS: usize = 4;

/// Decrease of the cost below which the shrinkage is not repeated.
const MIN_SHRINKAGE_DECREASE: f64 = 0.5;

/// Precision of the prior about the exponents of velocity and torque, which has mean zero: exponents of k_dec and x_e lie between
/// minus and plus one.
const EXPONENT_PRECISION: f64 = 1.0;

impl Fit {
    /// This fit with shrinkage, repeated as long as the cost decreases, since a new optimum gives a new target.
    pub fn with_shrinkage(&self, observations: &Observations) -> Self {
        let shrunk = |fit: &Self| {
            let target = Some(shrinkage_target(observations, fit));
            Self { shrinkage_target: target, ..fit.clone() }.extended(observations, &fit.model)
        };
        let mut best = shrunk(self);
        for _ in 0..MAX_REPETITIONS {
            let next = shrunk(&best);
            if next.cost() > best.cost() - MIN_SHRINKAGE_DECREASE {
                break;
            }
            best = next;
        }
        best
    }
}

/// The target of the shrinkage: the regression of the logarithms of k_dec and x_e on those of velocity and torque, over the trials
/// whose data determine the parameter, each weighted by its precision.
fn shrinkage_target(observations: &Observations, fit: &Fit) -> StartingValues {
    let uncertainties = uncertainties(observations, fit, &predictions(observations, fit));
    let mut parameters = fit.parameters.clone();
    let log_covariates = |trial: usize| {
        let own = &observations.trials[trial];
        [own.velocity_rad_s, own.torque_nm].map(|size| libm::log(size.abs().max(1e-3)))
    };
    let trials = observations.trials.len();
    let mean = [0, 1].map(|which| (0..trials).map(|t| log_covariates(t)[which]).sum::<f64>() / trials as f64);
    let regressors = |trial: usize| {
        let own = log_covariates(trial);
        Vector3::new(1.0, own[0] - mean[0], own[1] - mean[1])
    };
    for (parameter, sd) in SHRINKAGE_SDS {
        // The few trials with a determined parameter may lie on a line: without a prior the slope across it would be arbitrary.
        let mut square = Matrix3::from_diagonal(&Vector3::new(0.0, EXPONENT_PRECISION, EXPONENT_PRECISION));
        let mut right = Vector3::zeros();
        for (trial, own) in uncertainties.iter().enumerate() {
            let Some(se) = own.se[parameter].filter(|se| *se < 1.0) else { continue };
            let x = regressors(trial);
            let weight = 1.0 / (se * se + sd * sd);
            square += weight * x * x.transpose();
            right += weight * libm::log(fit.parameters[trial][parameter]) * x;
        }
        // Without any determined trial the matrix is singular, and the target is the fit itself.
        let Some(coefficients) = square.cholesky().map(|factor| factor.solve(&right)) else { continue };
        for (trial, own) in parameters.iter_mut().enumerate() {
            own[parameter] = libm::exp(coefficients.dot(&regressors(trial)));
        }
    }
    StartingValues::from_parameters(observations, &parameters)
}
