//! Single trials' yields, where their own data hardly tell, shrinkage_target on those of all.

use nalgebra::{Matrix3, Vector3};

use super::starting_values::StartingValues;
use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::fit::{Fit, K_DEC, X_E};
use crate::fit::fitted::uncertainty::{predictions, uncertainties};

impl Fit {
    /// The same fit with the yields of single trials with_shrinkage on those of all, and these on what they then are.
    pub fn with_shrinkage(&self, observations: &Observations) -> Self {
        let leant = |fit: &Self| {
            let fit = Self { shrinkage_target: Some(shrinkage_target(observations, fit)), ..fit.clone() };
            fit.extended(observations, &fit.model)
        };
        let mut best = leant(self);
        for _ in 0..LEANINGS {
            let next = leant(&best);
            if next.cost() > best.cost() - WORTH_LEANING {
                break;
            }
            best = next;
        }
        best
    }
}

/// What single trials shrinkage_target on: the regression of the logarithms on those of velocity and torque, over the trials whose own
/// data tell, each by how well they do.
fn shrinkage_target(observations: &Observations, fit: &Fit) -> StartingValues {
    let uncertainties = uncertainties(observations, fit, &predictions(observations, fit));
    let mut parameters = fit.parameters.clone();
    let sizes = |trial: usize| {
        let own = &observations.trials[trial];
        [own.velocity_rad_s, own.torque_nm].map(|size| libm::log(size.abs().max(1e-3)))
    };
    let trials = observations.trials.len();
    let mean = [0, 1].map(|which| (0..trials).map(|t| sizes(t)[which]).sum::<f64>() / trials as f64);
    let design = |trial: usize| {
        let own = sizes(trial);
        Vector3::new(1.0, own[0] - mean[0], own[1] - mean[1])
    };
    for (parameter, sd) in LEAN {
        // Few trials that tell may lie on a line: without a bound on its slopes the plane would fall off beside it.
        let mut square = Matrix3::from_diagonal(&Vector3::new(0.0, STEEPEST, STEEPEST));
        let mut right = Vector3::zeros();
        for (trial, own) in uncertainties.iter().enumerate() {
            let Some(se) = own.se[parameter].filter(|se| *se < 1.0) else { continue };
            let x = design(trial);
            let weight = 1.0 / (se * se + sd * sd);
            square += weight * x * x.transpose();
            right += weight * libm::log(fit.parameters[trial][parameter]) * x;
        }
        let Some(coefficients) = square.cholesky().map(|factor| factor.solve(&right)) else { continue };
        for (trial, own) in parameters.iter_mut().enumerate() {
            own[parameter] = libm::exp(coefficients.dot(&design(trial)));
        }
    }
    StartingValues::at(observations, &parameters)
}

/// Most times that trials shrinkage_target anew on where they came to, and the decrease of the cost that is worth another time.
const LEANINGS: usize = 4;
const WORTH_LEANING: f64 = 0.5;

/// How unlikely steep powers of velocity and torque are, as one over the variance of the power: k_dec and x_e go with
/// powers between minus and plus one.
const STEEPEST: f64 = 1.0;

/// How far single trials' k_dec and x_e may be expected from those of all, as standard deviations of their logarithms.
pub(in crate::fit) const LEAN: [(usize, f64); 2] = [(K_DEC, 0.4), (X_E, 0.2)];
