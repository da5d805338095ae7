//! The torque of every trial, linear in what is unknown: whitened residuals and their derivatives at a point.

use nalgebra::{DMatrix, DVector};

use crate::fit::{Fit, I_J, Observations, Transform, predictions};
use crate::wrist::BASE_PARAMETERS;

/// What is unknown of a session: which coordinates of a fit belong to single trials, and which are common.
///
/// Each trial has the same parameters of its own, as logarithms. All other coordinates are common to several trials.
#[derive(Debug, Clone)]
pub struct Unknowns {
    /// For each trial, the indices of its own coordinates.
    pub own: Vec<Vec<usize>>,
    /// The base parameters that a trial has of its own, in this order.
    pub parameters: Vec<usize>,
    /// Indices of the common coordinates.
    pub common: Vec<usize>,
}

impl Unknowns {
    /// The unknowns of `fit`. A parameter is a trial's own if it is so in every trial.
    pub fn of(fit: &Fit) -> Self {
        let own_of = |trial: usize, parameter: usize| match &fit.parameterisation.transforms[trial][parameter]
        {
            Transform::Logarithmic { coordinate, .. } => Some(*coordinate),
            _ => None,
        };
        let trials = fit.parameterisation.transforms.len();
        let is_own = |parameter: &usize| {
            let mut coordinates: Vec<usize> =
                (0..trials).filter_map(|trial| own_of(trial, *parameter)).collect();
            coordinates.sort_unstable();
            coordinates.dedup();
            coordinates.len() == trials && trials > 1
        };
        let parameters: Vec<usize> =
            (0..BASE_PARAMETERS.len()).filter(|p| *p != I_J).filter(is_own).collect();
        let own: Vec<Vec<usize>> = (0..trials)
            .map(|trial| parameters.iter().filter_map(|parameter| own_of(trial, *parameter)).collect())
            .collect();
        let mut is_common = vec![true; fit.parameterisation.coordinates.len()];
        own.iter().flatten().for_each(|coordinate| is_common[*coordinate] = false);
        let common = (0..is_common.len()).filter(|coordinate| is_common[*coordinate]).collect();
        Self { own, parameters, common }
    }
}

/// One trial at a point.
#[derive(Debug, Clone)]
pub struct LinearTrial {
    /// Whitened residuals, measured less predicted.
    pub residual: DVector<f64>,
    /// Derivatives of the whitened prediction with respect to the trial's own coordinates.
    pub own: DMatrix<f64>,
    /// The same with respect to the common coordinates.
    pub common: DMatrix<f64>,
}

/// A session at the coordinates of `fit`.
pub fn linearise(observations: &Observations, fit: &Fit, unknowns: &Unknowns) -> Vec<LinearTrial> {
    let mut place_of = vec![None; fit.parameterisation.coordinates.len()];
    for (place, coordinate) in unknowns.common.iter().enumerate() {
        place_of[*coordinate] = Some(place);
    }
    let trial = |(trial, prediction): (usize, crate::fit::Prediction)| {
        let noise = observations.noise_index[trial];
        let white = fit.objective.whiten_columns(noise, &prediction.jacobian);
        let mut linear = LinearTrial {
            residual: fit.objective.whiten(noise, &prediction.residual_nm),
            own: DMatrix::zeros(white.nrows(), unknowns.own[trial].len()),
            common: DMatrix::zeros(white.nrows(), unknowns.common.len()),
        };
        for (row, parameter) in fit.parameterisation.estimated.iter().enumerate() {
            let value = fit.parameters[trial][*parameter];
            fit.parameterisation.slopes(trial, *parameter, value, |coordinate, slope| {
                let change = white.column(row) * slope;
                if let Some(place) = place_of[coordinate] {
                    let mut column = linear.common.column_mut(place);
                    column += change;
                } else if let Some(place) = unknowns.own[trial].iter().position(|own| *own == coordinate) {
                    let mut column = linear.own.column_mut(place);
                    column += change;
                }
            });
        }
        linear
    };
    predictions(observations, fit).into_iter().enumerate().map(trial).collect()
}
