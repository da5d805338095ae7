//! How well the parameters are known: Eq. 9 of the paper, and standard errors from the noise that the holds show.

use nalgebra::{DMatrix, DVector};

use super::fit::Fit;
use crate::fit::data::preprocessing::Observations;
use crate::fit::residuals::prediction::predict;
use crate::fit::solver::normal_equations::{Objective, evaluate};
use crate::wrist::{BASE_PARAMETERS, SimulatedTorque};

/// One trial's uncertainty, by the six base parameters; relative to the parameter.
#[derive(Debug, Clone, PartialEq)]
pub struct Uncertainty {
    /// Eq. 9: counts every sample as independent.
    pub sem: [Option<f64>; 6],
    /// From the measured noise covariance; `None` without a hold, or where the data do not determine the parameter.
    pub se: [Option<f64>; 6],
}

/// Predicted torque of a trial, its residuals (measured less predicted) and derivatives by the estimated parameters.
pub struct Prediction {
    /// Predicted torque, N m.
    pub torque_nm: Vec<f64>,
    /// Measured less predicted, N m.
    pub residual_nm: Vec<f64>,
    /// Derivatives of the prediction: samples by estimated parameters.
    pub jacobian: DMatrix<f64>,
}

/// Predictions of all trials at the optimum.
pub fn predictions(observations: &Observations, fit: &Fit) -> Vec<Prediction> {
    let trials: Vec<usize> = (0..observations.trials.len()).collect();
    let flat: Vec<f64> = fit.parameters.iter().flatten().copied().collect();
    let wanted = &fit.parameterisation.estimated;
    let mut response = SimulatedTorque::default();
    predict(observations, &fit.kinds, wanted, &trials, &flat, &mut response);
    let samples = observations.samples;
    trials
        .iter()
        .map(|trial| {
            let torque_nm = response.torque_nm[trial * samples..(trial + 1) * samples].to_vec();
            let slopes =
                &response.slopes[trial * samples * wanted.len()..(trial + 1) * samples * wanted.len()];
            let measured = &observations.trials[*trial].measured_nm;
            Prediction {
                residual_nm: measured.iter().zip(&torque_nm).map(|(m, p)| m - p).collect(),
                torque_nm,
                jacobian: DMatrix::from_row_slice(samples, wanted.len(), slopes),
            }
        })
        .collect()
}

/// Variance accounted for, of torque: Eq. 8 prints the angle, but what is fitted and judged is the torque.
pub fn variance_accounted_for(measured_nm: &[f64], residual_nm: &[f64]) -> f64 {
    let square = |values: &[f64]| values.iter().map(|x| x * x).sum::<f64>();
    1.0 - square(residual_nm) / square(measured_nm)
}

/// The uncertainty of every trial's parameters.
pub fn uncertainties(observations: &Observations, fit: &Fit, predictions: &[Prediction]) -> Vec<Uncertainty> {
    let honest = covariance(observations, fit, predictions);
    (0..observations.trials.len())
        .map(|trial| Uncertainty {
            sem: sem(fit, trial, &predictions[trial]),
            se: standard_errors(fit, trial, honest.as_deref()),
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

/// The covariance of the coordinates, component by component; `None` where no noise could be measured.
///
/// For a whitened fit it is the inverse of the Gauss-Newton matrix; for plain least squares the sandwich
/// H^-1 J'CJ H^-1 with the measured covariance C. Coordinates at a bound count as known.
pub fn covariance(
    observations: &Observations,
    fit: &Fit,
    predictions: &[Prediction],
) -> Option<Vec<DMatrix<f64>>> {
    if fit.residual_covariances.is_empty() {
        return None;
    }
    let components: Vec<_> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    let normals = evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at);
    let of_component = |(component, normal): (
        &&crate::fit::parameters::parameterisation::Component,
        &crate::fit::solver::normal_equations::NormalEquations,
    )| {
        let order = component.order();
        let mut matrix = normal.dense(component);
        let held: Vec<bool> = order
            .iter()
            .map(|index| {
                let (c, x) = (&fit.parameterisation.coordinates[*index], at[*index]);
                x <= c.low + 1e-6 || x >= c.high - 1e-6
            })
            .collect();
        for (i, held) in held.iter().enumerate() {
            if *held {
                matrix.row_mut(i).fill(0.0);
                matrix.column_mut(i).fill(0.0);
                matrix[(i, i)] = 1.0;
            }
        }
        let Some(mut inverse) = invert_scaled(matrix) else {
            return DMatrix::from_element(order.len(), order.len(), f64::INFINITY);
        };
        if let Objective::LeastSquares = fit.objective {
            let filling = filling(observations, fit, predictions, component, &order);
            inverse = &inverse * filling * &inverse;
        }
        for (i, held) in held.iter().enumerate() {
            if *held {
                inverse.row_mut(i).fill(0.0);
                inverse.column_mut(i).fill(0.0);
            }
        }
        inverse
    };
    Some(components.iter().zip(&normals).map(of_component).collect())
}

/// The filling of the sandwich: the sum over trials of J'CJ, C being the measured covariance between all samples.
fn filling(
    observations: &Observations,
    fit: &Fit,
    predictions: &[Prediction],
    component: &crate::fit::parameters::parameterisation::Component,
    order: &[usize],
) -> DMatrix<f64> {
    let places: Vec<usize> = observations.noise_samples().collect();
    let mut filling = DMatrix::zeros(order.len(), order.len());
    for trial in &component.trials {
        let Some(noise) = observations.noise_index[*trial] else { continue };
        let jacobian = &predictions[*trial].jacobian;
        // The covariance is known on every stride-th sample; between them noise and derivatives are smooth, so that the sum
        // over all samples is that over these, each standing for its neighbours.
        let weight = observations.samples as f64 / places.len() as f64;
        let rows = DMatrix::from_fn(places.len(), jacobian.ncols(), |i, j| weight * jacobian[(places[i], j)]);
        let mut to_coordinates = DMatrix::zeros(jacobian.ncols(), order.len());
        for (row, parameter) in fit.parameterisation.estimated.iter().enumerate() {
            fit.parameterisation.slopes(
                *trial,
                *parameter,
                fit.parameters[*trial][*parameter],
                |coordinate, slope| {
                    if let Some(column) = order.iter().position(|index| *index == coordinate) {
                        to_coordinates[(row, column)] = slope;
                    }
                },
            );
        }
        let full = rows * to_coordinates;
        filling += full.tr_mul(&(&fit.residual_covariances[noise].covariance * &full));
    }
    filling
}

impl Fit {
    /// Standard errors of the first trial's parameters, the mechanisms' included; absent where the data do not tell.
    pub fn standard_errors(&self, observations: &Observations) -> Vec<Option<f64>> {
        let count = self.parameters[0].len();
        let Some(covariances) = covariance(observations, self, &predictions(observations, self)) else {
            return vec![None; count];
        };
        (0..count).map(|parameter| standard_error(self, 0, parameter, &covariances)).collect()
    }
}

/// Standard error of one parameter of a trial.
fn standard_error(fit: &Fit, trial: usize, parameter: usize, covariances: &[DMatrix<f64>]) -> Option<f64> {
    if fit.at_bound(trial, parameter) || !fit.parameterisation.estimated.contains(&parameter) {
        return None;
    }
    let index =
        fit.parameterisation.components.iter().position(|component| component.trials.contains(&trial))?;
    let order = fit.parameterisation.components[index].order();
    let mut gradient = DVector::zeros(order.len());
    fit.parameterisation.slopes(trial, parameter, fit.parameters[trial][parameter], |coordinate, slope| {
        if let Some(place) = order.iter().position(|own| *own == coordinate) {
            gradient[place] = slope;
        }
    });
    finite(libm::sqrt(gradient.dot(&(&covariances[index] * &gradient))))
}

/// Standard errors of a trial's base parameters relative to them.
fn standard_errors(fit: &Fit, trial: usize, covariances: Option<&[DMatrix<f64>]>) -> [Option<f64>; 6] {
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

/// The inverse of a positive definite matrix, scaled first; `None` if it is singular.
pub(in crate::fit) fn invert_scaled(matrix: DMatrix<f64>) -> Option<DMatrix<f64>> {
    let scale: Vec<f64> =
        matrix.diagonal().iter().map(|x| 1.0 / libm::sqrt(x.max(f64::MIN_POSITIVE))).collect();
    let scaled =
        DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| matrix[(i, j)] * scale[i] * scale[j]);
    let inverse = nalgebra::Cholesky::new(scaled)?.inverse();
    Some(DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, j| inverse[(i, j)] * scale[i] * scale[j]))
}
