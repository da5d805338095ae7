//! Standard errors of the parameters: Eq. 9 of the paper, and from the estimated covariance of the residuals.

use nalgebra::{DMatrix, DVector};

use super::fit::Fit;
use super::predictions::Prediction;
use crate::fit::data::observations::Observations;
use crate::fit::linalg::invert_scaled;
use crate::fit::parameters::component::Component;
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::normal_equations::{GaussNewtonEquations, evaluate};
use crate::wrist::BASE_PARAMETERS;

/// Relative standard errors of the six base parameters of one trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Eq. 9, which counts every sample as independent; `None` if the parameter is fixed or not determined.
    pub sem: [Option<f64>; 6],
    /// Standard error from the covariance of the residuals; `None` if the covariance is unknown, or the parameter fixed, at a bound or
    /// not determined.
    pub se: [Option<f64>; 6],
}

/// Uncertainty of the base parameters of every trial.
pub fn uncertainties(observations: &Observations, fit: &Fit, predictions: &[Prediction]) -> Vec<Uncertainty> {
    let covariances = coordinate_covariances(observations, fit, predictions);
    (0..observations.trials.len())
        .map(|trial| Uncertainty {
            sem: sem(fit, trial, &predictions[trial]),
            se: relative_standard_errors(fit, trial, covariances.as_deref()),
        })
        .collect()
}

/// Eq. 9, relative to the parameter: sqrt(1/n diag((J'J)^-1) sum E^2).
fn sem(fit: &Fit, trial: usize, prediction: &Prediction) -> [Option<f64>; 6] {
    let mut sem = [None; 6];
    let parameters = &fit.parameters[trial];
    let mut scaled = prediction.jacobian.clone();
    for (column, parameter) in fit.parameterisation.estimated.iter().enumerate() {
        scaled.column_mut(column).scale_mut(parameters[*parameter]);
    }
    let squares: f64 = prediction.residual_nm.iter().map(|e| e * e).sum();
    let Some(inverse) = invert_scaled(scaled.tr_mul(&scaled)) else { return sem };
    for (column, parameter) in fit.parameterisation.estimated.iter().enumerate() {
        if *parameter < BASE_PARAMETERS.len() {
            let variance = inverse[(column, column)] * squares / prediction.residual_nm.len() as f64;
            sem[*parameter] = finite(libm::sqrt(variance));
        }
    }
    sem
}

/// Covariance of the coordinates of each component, in the order of the component; `None` if the covariance of the residuals is
/// unknown.
///
/// For whitened residuals it is the inverse of the Gauss-Newton matrix H. For ordinary least squares it is the sandwich estimator
/// H^-1 J'CJ H^-1 with the estimated covariance C of the residuals. Coordinates at a bound count as known.
pub fn coordinate_covariances(
    observations: &Observations,
    fit: &Fit,
    predictions: &[Prediction],
) -> Option<Vec<DMatrix<f64>>> {
    if fit.residual_covariances.is_empty() {
        return None;
    }
    let components: Vec<_> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    let equations =
        evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at);
    let of_component = |(component, equations): (&&Component, &GaussNewtonEquations)| {
        let order = component.order();
        let Some(inverse) = inverse_normal_matrix(fit, component, equations) else {
            return DMatrix::from_element(order.len(), order.len(), f64::INFINITY);
        };
        match fit.objective {
            Objective::LeastSquares => {
                &inverse * sandwich_meat(observations, fit, predictions, component, &order) * &inverse
            }
            Objective::Whitened(_) => inverse,
        }
    };
    Some(components.iter().zip(&equations).map(of_component).collect())
}

/// Inverse of the Gauss-Newton matrix of a component, in its order; rows and columns of coordinates at a bound, which count as known,
/// are zero. `None` if the data do not determine the others.
pub(in crate::fit) fn inverse_normal_matrix(
    fit: &Fit,
    component: &Component,
    equations: &GaussNewtonEquations,
) -> Option<DMatrix<f64>> {
    let mut matrix = equations.dense(component);
    let held: Vec<usize> =
        (0..matrix.nrows()).filter(|place| fit.coordinate_at_bound(component.order()[*place])).collect();
    for place in &held {
        matrix.row_mut(*place).fill(0.0);
        matrix.column_mut(*place).fill(0.0);
        matrix[(*place, *place)] = 1.0;
    }
    let mut inverse = invert_scaled(matrix)?;
    for place in &held {
        inverse.row_mut(*place).fill(0.0);
        inverse.column_mut(*place).fill(0.0);
    }
    Some(inverse)
}

/// The middle factor of the sandwich estimator: the sum over trials of J'CJ, with the covariance C between all samples.
fn sandwich_meat(
    observations: &Observations,
    fit: &Fit,
    predictions: &[Prediction],
    component: &Component,
    order: &[usize],
) -> DMatrix<f64> {
    let samples: Vec<usize> = observations.noise_samples().collect();
    let mut meat = DMatrix::zeros(order.len(), order.len());
    for trial in &component.trials {
        let Some(noise) = observations.noise_index[*trial] else { continue };
        let jacobian = &predictions[*trial].jacobian;
        // The covariance is known on the noise samples. Noise and derivatives are smooth in between, so each noise sample stands for
        // its neighbours in the sum over all samples.
        let weight = observations.rows() as f64 / samples.len() as f64;
        let rows =
            DMatrix::from_fn(samples.len(), jacobian.ncols(), |i, j| weight * jacobian[(samples[i], j)]);
        let mut to_coordinates = DMatrix::zeros(jacobian.ncols(), order.len());
        for (row, parameter) in fit.parameterisation.estimated.iter().enumerate() {
            let value = fit.parameters[*trial][*parameter];
            fit.parameterisation.slopes(*trial, *parameter, value, |coordinate, slope| {
                if let Some(column) = order.iter().position(|index| *index == coordinate) {
                    to_coordinates[(row, column)] = slope;
                }
            });
        }
        let full = rows * to_coordinates;
        meat += full.tr_mul(&(&fit.residual_covariances[noise].covariance * &full));
    }
    meat
}

/// Standard error of one parameter of a trial, in the unit of the parameter.
fn standard_error(fit: &Fit, trial: usize, parameter: usize, covariances: &[DMatrix<f64>]) -> Option<f64> {
    if fit.at_bound(trial, parameter) || !fit.parameterisation.estimated.contains(&parameter) {
        return None;
    }
    let index =
        fit.parameterisation.components.iter().position(|component| component.trials.contains(&trial))?;
    let order = fit.parameterisation.components[index].order();
    let mut gradient = DVector::zeros(order.len());
    let value = fit.parameters[trial][parameter];
    fit.parameterisation.slopes(trial, parameter, value, |coordinate, slope| {
        if let Some(position) = order.iter().position(|own| *own == coordinate) {
            gradient[position] = slope;
        }
    });
    finite(libm::sqrt(gradient.dot(&(&covariances[index] * &gradient))))
}

/// Standard errors of the base parameters of a trial, relative to the parameters.
fn relative_standard_errors(
    fit: &Fit,
    trial: usize,
    covariances: Option<&[DMatrix<f64>]>,
) -> [Option<f64>; 6] {
    let mut se = [None; 6];
    let Some(covariances) = covariances else { return se };
    for (parameter, slot) in se.iter_mut().enumerate() {
        let value = fit.parameters[trial][parameter];
        *slot = standard_error(fit, trial, parameter, covariances).and_then(|own| finite(own / value.abs()));
    }
    se
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}
