//! Gauss-Newton normal equations of a component, accumulated trial by trial.

use nalgebra::{DMatrix, DVector};

use crate::fit::data::observations::Observations;
use crate::fit::parameters::component::{Component, Position};
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::residuals::objective::Objective;
use crate::fit::residuals::prediction::predict;
use crate::wrist::SimulatedTorque;
use crate::wrist::mechanisms::MechanismKind;

/// Normal equations of one component in arrowhead form; residuals are predicted less measured torque.
#[derive(Debug, Clone)]
pub struct GaussNewtonEquations {
    /// Half the sum of squared residuals, priors included.
    pub cost: f64,
    /// The part of each block.
    pub(super) blocks: Vec<BlockEquations>,
    /// Gauss-Newton matrix of the border's coordinates.
    pub(super) border: DMatrix<f64>,
    /// Gradient of the cost with respect to the border's coordinates.
    pub(super) border_gradient: DVector<f64>,
}

/// Part of the normal equations that the trials of one block contribute.
#[derive(Debug, Clone)]
pub(super) struct BlockEquations {
    /// Half the sum of squared residuals of the block's trials, priors of the block's coordinates included.
    pub cost: f64,
    /// Gauss-Newton matrix: block's coordinates by block's coordinates.
    pub matrix: DMatrix<f64>,
    /// Gauss-Newton matrix: block's coordinates by border's coordinates.
    pub with_border: DMatrix<f64>,
    /// Gradient with respect to the block's coordinates.
    pub gradient: DVector<f64>,
    /// Contribution of the block's trials to the Gauss-Newton matrix of the border.
    pub border_share: DMatrix<f64>,
    /// Contribution of the block's trials to the gradient of the border.
    pub border_gradient_share: DVector<f64>,
}

/// Normal equations of one trial, by the estimated parameters.
struct TrialEquations {
    /// J'J, parameters by parameters.
    matrix: DMatrix<f64>,
    /// J'r, one value per parameter.
    gradient: DVector<f64>,
    /// Half the sum of squared residuals.
    cost: f64,
}

/// Evaluates the normal equations of `components` at `coordinates`. One simulation gives the residuals and the derivatives of all
/// trials.
pub fn evaluate(
    observations: &Observations,
    parameterisation: &Parameterisation,
    kinds: &[MechanismKind],
    objective: &Objective,
    components: &[&Component],
    coordinates: &[f64],
) -> Vec<GaussNewtonEquations> {
    let (parameters, response) = simulated(observations, parameterisation, kinds, components, coordinates);
    let mut row = 0;
    let count = parameterisation.transforms[0].len();
    let estimated = parameterisation.estimated.len();
    let mut result = Vec::with_capacity(components.len());
    for component in components {
        let mut equations = GaussNewtonEquations::zero(component);
        for (trial, block) in component.trials.iter().zip(&component.block_of_trial) {
            let of_trial = trial_equations(observations, objective, *trial, &response, row, estimated);
            let parameters = &parameters[row * count..(row + 1) * count];
            equations.add_trial(component, parameterisation, *block, *trial, parameters, &of_trial);
            row += 1;
        }
        equations.add_priors(component, parameterisation, coordinates);
        equations.add_border_prior(component, coordinates);
        result.push(equations);
    }
    result
}

/// The parameters of all trials of `components`, in this order, and their simulation with the derivatives by the estimated ones.
fn simulated(
    observations: &Observations,
    parameterisation: &Parameterisation,
    kinds: &[MechanismKind],
    components: &[&Component],
    coordinates: &[f64],
) -> (Vec<f64>, SimulatedTorque) {
    let trials: Vec<usize> = components.iter().flat_map(|component| &component.trials).copied().collect();
    let mut parameters = Vec::new();
    for trial in &trials {
        parameterisation.parameters(*trial, coordinates, &mut parameters);
    }
    let mut response = SimulatedTorque::default();
    predict(observations, kinds, &parameterisation.estimated, &trials, &parameters, &mut response);
    (parameters, response)
}

/// Derivatives of the whitened values of each of `components` with respect to its coordinates, in the order of the component, and the
/// whitened residuals in the last column; one row per value of its trials.
pub fn whitened_derivatives(
    observations: &Observations,
    parameterisation: &Parameterisation,
    kinds: &[MechanismKind],
    objective: &Objective,
    components: &[&Component],
    coordinates: &[f64],
) -> Vec<DMatrix<f64>> {
    let (parameters, response) = simulated(observations, parameterisation, kinds, components, coordinates);
    let count = parameterisation.transforms[0].len();
    let mut place = 0;
    let mut of_component = |component: &&Component| {
        let order = component.order();
        let mut of_trials = Vec::new();
        for trial in &component.trials {
            let by_parameter =
                columns(observations, *trial, &response, place, parameterisation.estimated.len());
            let by_parameter = objective.whiten_columns(observations.noise_index[*trial], &by_parameter);
            let mut own = DMatrix::zeros(by_parameter.nrows(), order.len() + 1);
            own.set_column(order.len(), &by_parameter.column(parameterisation.estimated.len()));
            for (from, parameter) in parameterisation.estimated.iter().enumerate() {
                let value = parameters[place * count + parameter];
                parameterisation.slopes(*trial, *parameter, value, |coordinate, slope| {
                    let to = order.iter().position(|index| *index == coordinate);
                    let mut to = own.column_mut(to.expect("a coordinate of the trial's component"));
                    to.axpy(slope, &by_parameter.column(from), 1.0);
                });
            }
            of_trials.push(own);
            place += 1;
        }
        let rows = of_trials.iter().map(DMatrix::nrows).sum();
        let mut stacked = DMatrix::zeros(rows, order.len() + 1);
        let mut row = 0;
        for own in of_trials {
            stacked.rows_mut(row, own.nrows()).copy_from(&own);
            row += own.nrows();
        }
        stacked
    };
    components.iter().map(&mut of_component).collect()
}

/// Derivatives of the values of `trial` by the estimated parameters, value by value, and its residuals; its simulation is number `row` of
/// the response.
fn trial_values<'a>(
    observations: &'a Observations,
    trial: usize,
    response: &'a SimulatedTorque,
    row: usize,
    estimated: usize,
) -> (&'a [f64], impl Iterator<Item = f64> + Clone + 'a) {
    let samples = observations.rows();
    let torque = &response.torque_nm[row * samples..(row + 1) * samples];
    let slopes = &response.slopes[row * samples * estimated..(row + 1) * samples * estimated];
    let measured = &observations.trials[trial].measured_nm;
    (slopes, torque.iter().zip(measured).map(|(predicted, measured)| predicted - measured))
}

/// Derivatives of the values of `trial`, whose simulation is number `row` of the response, by the estimated parameters, and the residuals in
/// the last column.
fn columns(
    observations: &Observations,
    trial: usize,
    response: &SimulatedTorque,
    row: usize,
    estimated: usize,
) -> DMatrix<f64> {
    let (slopes, residual) = trial_values(observations, trial, response, row, estimated);
    let mut columns = DMatrix::zeros(observations.rows(), estimated + 1);
    for (row, slopes) in slopes.chunks_exact(estimated.max(1)).enumerate() {
        for (column, slope) in slopes.iter().enumerate() {
            columns[(row, column)] = *slope;
        }
    }
    columns.column_mut(estimated).iter_mut().zip(residual).for_each(|(to, from)| *to = from);
    columns
}

/// Normal equations of `trial`, whose simulation is number `row` of the response.
fn trial_equations(
    observations: &Observations,
    objective: &Objective,
    trial: usize,
    response: &SimulatedTorque,
    row: usize,
    estimated: usize,
) -> TrialEquations {
    match objective.whitening_matrix(observations.noise_index[trial]) {
        Some(whitening) => {
            // One product for the derivatives and the residual.
            let whitened = whitening * columns(observations, trial, response, row, estimated);
            let (jacobian, residual) = (whitened.columns(0, estimated), whitened.column(estimated));
            TrialEquations {
                cost: 0.5 * residual.norm_squared(),
                gradient: jacobian.tr_mul(&residual),
                matrix: jacobian.tr_mul(&jacobian),
            }
        }
        None => {
            let (slopes, residual) = trial_values(observations, trial, response, row, estimated);
            let mut matrix = DMatrix::zeros(estimated, estimated);
            let mut gradient = DVector::zeros(estimated);
            let mut cost = 0.0;
            for (slopes, residual) in slopes.chunks_exact(estimated.max(1)).zip(residual.clone()) {
                for a in 0..estimated {
                    gradient[a] += slopes[a] * residual;
                    for b in 0..=a {
                        matrix[(a, b)] += slopes[a] * slopes[b];
                    }
                }
            }
            for residual in residual {
                cost += 0.5 * residual * residual;
            }
            matrix.fill_upper_triangle_with_lower_triangle();
            TrialEquations { matrix, gradient, cost }
        }
    }
}

impl GaussNewtonEquations {
    /// Normal equations of no data.
    fn zero(component: &Component) -> Self {
        let border = component.border.len();
        let block = |own: &Vec<usize>| BlockEquations {
            cost: 0.0,
            matrix: DMatrix::zeros(own.len(), own.len()),
            with_border: DMatrix::zeros(own.len(), border),
            gradient: DVector::zeros(own.len()),
            border_share: DMatrix::zeros(border, border),
            border_gradient_share: DVector::zeros(border),
        };
        Self {
            cost: 0.0,
            blocks: component.blocks.iter().map(block).collect(),
            border: DMatrix::zeros(border, border),
            border_gradient: DVector::zeros(border),
        }
    }

    /// Adds the equations of a trial of `block` at its `parameters`, by the chain rule from parameters to coordinates.
    fn add_trial(
        &mut self,
        component: &Component,
        parameterisation: &Parameterisation,
        block: usize,
        trial: usize,
        parameters: &[f64],
        of_trial: &TrialEquations,
    ) {
        // For each coordinate of each estimated parameter: the parameter's row, the coordinate's position and the derivative.
        let mut entries: Vec<(usize, Position, f64)> = Vec::with_capacity(parameterisation.estimated.len());
        for (row, parameter) in parameterisation.estimated.iter().enumerate() {
            parameterisation.slopes(trial, *parameter, parameters[*parameter], |coordinate, slope| {
                let position = component.position(block, coordinate);
                entries.push((row, position.expect("a coordinate of the trial's component"), slope));
            });
        }
        self.cost += of_trial.cost;
        let own = &mut self.blocks[block];
        own.cost += of_trial.cost;
        for (row, position, slope) in &entries {
            match position {
                Position::Block(a) => own.gradient[*a] += slope * of_trial.gradient[*row],
                Position::Border(a) => {
                    self.border_gradient[*a] += slope * of_trial.gradient[*row];
                    own.border_gradient_share[*a] += slope * of_trial.gradient[*row];
                }
            }
            for (other_row, other_position, other_slope) in &entries {
                let value = slope * other_slope * of_trial.matrix[(*row, *other_row)];
                match (position, other_position) {
                    (Position::Block(a), Position::Block(b)) => own.matrix[(*a, *b)] += value,
                    (Position::Block(a), Position::Border(b)) => own.with_border[(*a, *b)] += value,
                    (Position::Border(_), Position::Block(_)) => {}
                    (Position::Border(a), Position::Border(b)) => {
                        self.border[(*a, *b)] += value;
                        own.border_share[(*a, *b)] += value;
                    }
                }
            }
        }
    }

    /// Adds the Gaussian priors of the coordinates.
    fn add_priors(&mut self, component: &Component, parameterisation: &Parameterisation, at: &[f64]) {
        // Deviation from the mean of the prior, in standard deviations, and the standard deviation.
        let prior = |coordinate: &usize| {
            let (mean, sd) = parameterisation.coordinates[*coordinate].prior?;
            Some(((at[*coordinate] - mean) / sd, sd))
        };
        for (own, block) in component.blocks.iter().zip(&mut self.blocks) {
            for (position, coordinate) in own.iter().enumerate() {
                if let Some((deviation, sd)) = prior(coordinate) {
                    self.cost += 0.5 * deviation * deviation;
                    block.cost += 0.5 * deviation * deviation;
                    block.gradient[position] += deviation / sd;
                    block.matrix[(position, position)] += 1.0 / (sd * sd);
                }
            }
        }
        for (position, coordinate) in component.border.iter().enumerate() {
            if let Some((deviation, sd)) = prior(coordinate) {
                self.cost += 0.5 * deviation * deviation;
                self.border_gradient[position] += deviation / sd;
                self.border[(position, position)] += 1.0 / (sd * sd);
            }
        }
    }

    /// Adds the information about the border from trials outside the component.
    fn add_border_prior(&mut self, component: &Component, at: &[f64]) {
        let Some(prior) = &component.border_prior else { return };
        let deviation =
            DVector::from_fn(component.border.len(), |i, _| at[component.border[i]] - prior.at[i]);
        let slope = &prior.information * &deviation;
        self.cost += prior.gradient.dot(&deviation) + 0.5 * slope.dot(&deviation);
        self.border_gradient += &prior.gradient + slope;
        self.border += &prior.information;
    }
}
