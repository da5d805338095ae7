//! Refits of sessions that are simulated from a fit, each with a search for other optima along x_e.
//!
//! Such sessions differ in their noise alone. The torque that the model predicts at other values of x_e, and its derivatives, are the same
//! for all of them and are computed once. How well a session can be explained there then takes no simulation, only the products of these
//! derivatives with its noise; a trial is simulated again where that promises another optimum.
//!
//! The other optima that the search found for the fit itself would not do: the noise of a session decides which of its optima exist.

use nalgebra::{DMatrix, DVector};

use super::multistart::{AlternativeOptimum, MAX_ROUNDS, present_cost};
use crate::fit::data::observations::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::Fit;
use crate::fit::fitted::predictions::predictions;
use crate::fit::linalg::cholesky;
use crate::fit::model::parameter_index::X_E;
use crate::fit::parameters::component::BorderPrior;
use crate::fit::parameters::coordinate::Coordinate;
use crate::fit::population::session_priors::DECREMENT_RATIO;
use crate::fit::solver::levenberg_marquardt::solve;
use crate::fit::solver::options::SolverOptions;

/// Number of values of x_e that are looked at, and the least and the greatest of them as fractions of the largest motor angle in the window.
const PLACES_ALONG_X_E: usize = 16;
const PLACE_FRACTIONS: [f64; 2] = [0.081, 1.0];

/// Options of these descents, at the end of which the derivatives are taken. They need not be exact, since the other parameters follow the
/// noise.
const PLACE_OPTIONS: SolverOptions = SolverOptions { max_iterations: 12, tolerance: 1e-4, max_log_step: 0.7 };

/// Options of a refit before it has found its optima; it is completed with the usual ones.
const ROUGH_OPTIONS: SolverOptions =
    SolverOptions { max_iterations: 100, tolerance: 1e-4, max_log_step: 0.7 };

/// In the first round a block descends from a place where the predicted cost exceeds the present one by less than this, per unit of noise
/// variance, since the optimum lies below the place; later only where the predicted cost is lower.
const MAX_PLACE_EXCESS: f64 = 1.0;

/// Smallest decrease of a block's cost, per unit of noise variance, for which another optimum is adopted: a fiftieth of a unit of
/// chi-square.
const MIN_REFIT_DECREASE: f64 = 1e-2;

/// Largest step of a coordinate from a place to the start of a descent.
const LARGEST_PLACE_STEP: f64 = 0.7;

/// Relative damping of that step. k_srs and k_dec are so alike that more would hide a part of what they can explain together.
const PLACE_DAMPING: f64 = 1e-7;

/// Refits of sessions that are simulated from one fit.
pub struct RefitSearch<'a> {
    fit: &'a Fit,
    /// Predicted values of each trial, N m.
    predicted_nm: Vec<Vec<f64>>,
    /// The places of each block that has its own x_e.
    blocks: Vec<BlockPlaces>,
}

/// Places of a block along x_e.
struct BlockPlaces {
    block: BlockIndex,
    trials: Vec<usize>,
    /// Position of x_e in the block.
    x_e: usize,
    /// In ascending order of x_e.
    places: Vec<ProfilePoint>,
    /// For each place, the whitened derivatives of the block's values, and their whitened distance from those of the fit; side by side.
    derivatives: DMatrix<f64>,
}

/// The best of a block at one value of x_e, without noise; coordinates in the order of the block, then of the border.
struct ProfilePoint {
    coordinates: Vec<f64>,
    /// Cost of the block, its gradient and its Gauss-Newton matrix.
    cost: f64,
    gradient: DVector<f64>,
    matrix: DMatrix<f64>,
}

impl<'a> RefitSearch<'a> {
    /// Prepares refits of sessions that are simulated from `fit`.
    pub fn new(observations: &Observations, fit: &'a Fit) -> Self {
        let predicted_nm: Vec<Vec<f64>> =
            predictions(observations, fit).into_iter().map(|own| own.torque_nm).collect();
        let blocks =
            if fit.has_local_x_e() { block_places(observations, &predicted_nm, fit) } else { Vec::new() };
        Self { fit, predicted_nm, blocks }
    }

    /// The fit repeated on a simulated session: from the optimum that it was simulated from, and in each block from the places that promise
    /// another optimum. The parameters that trials share are nearly right already, so components need not be restarted.
    pub fn refit(&self, session: &Observations) -> Fit {
        let Fit { parameterisation, kinds, objective, .. } = self.fit;
        let from =
            |start: &[f64], options| solve(session, parameterisation, kinds, objective, start, options);
        let mut fit = self.fit.at_solution(from(&self.fit.solution.coordinates, ROUGH_OPTIONS));
        let noise: Vec<DVector<f64>> = (session.trials.iter().zip(&self.predicted_nm).enumerate())
            .map(|(trial, (own, predicted))| {
                let noise: Vec<f64> = own.measured_nm.iter().zip(predicted).map(|(m, p)| m - p).collect();
                objective.whiten(session.noise_index[trial], &noise)
            })
            .collect();
        let mut open = vec![true; parameterisation.components.len()];
        for round in 0..MAX_ROUNDS {
            let max_excess = if round == 0 { MAX_PLACE_EXCESS } else { 0.0 };
            let mut found = self.alternative_optima(session, &fit, &noise, &open, max_excess);
            found.retain(|own| own.decrease > MIN_REFIT_DECREASE);
            if found.is_empty() {
                break;
            }
            open = fit.adopt_best_blocks(session, &found, ROUGH_OPTIONS);
        }
        let completed = from(&fit.solution.coordinates, SolverOptions::default());
        Fit { other_optima: Vec::new(), ..fit.at_solution(completed) }
    }

    /// The optima that the blocks of the `open` components reach from the places that promise one.
    fn alternative_optima(
        &self,
        session: &Observations,
        fit: &Fit,
        noise: &[DVector<f64>],
        open: &[bool],
        max_excess: f64,
    ) -> Vec<AlternativeOptimum> {
        let present = fit.normal_equations(session);
        let at = &fit.solution.coordinates;
        let with_component = present.iter().zip(&fit.parameterisation.components);
        let others: Vec<Vec<BorderPrior>> =
            with_component.map(|(own, component)| own.border_priors_from_others(component, at)).collect();
        let (mut blocks, mut starts) = (Vec::new(), Vec::new());
        for own in self.blocks.iter().filter(|own| open[own.block.0]) {
            let (component, block) = own.block;
            let log_x_e = at[fit.parameterisation.components[component].blocks[block][own.x_e]];
            let cost = present_cost(&present[component], own.block);
            let most = cost + max_excess * fit.cost_unit(session, own.block, &present[component]);
            for start in own.promising(log_x_e, [cost, most], &others[component][block], noise) {
                blocks.push(own.block);
                starts.extend(start);
            }
        }
        if blocks.is_empty() {
            return Vec::new();
        }
        let subproblems = BlockSubproblems::new(session, fit, &present, &blocks);
        for (value, bounds) in starts.iter_mut().zip(&subproblems.parameterisation.coordinates) {
            *value = value.clamp(bounds.low, bounds.high);
        }
        let all: Vec<usize> = (0..blocks.len()).collect();
        fit.optima_from(session, &present, (&subproblems, &blocks), &all, &starts)
    }
}

/// The places of all blocks that have their own x_e.
fn block_places(observations: &Observations, predicted_nm: &[Vec<f64>], fit: &Fit) -> Vec<BlockPlaces> {
    let mut session = observations.clone();
    for (trial, predicted) in session.trials.iter_mut().zip(predicted_nm) {
        trial.measured_nm.clone_from(predicted);
    }
    let equations = fit.normal_equations(&session);
    let has_own_x_e = |block: &BlockIndex| fit.coordinate_of(block.0, block.1, X_E).is_some();
    let blocks: Vec<BlockIndex> = (fit.parameterisation.components.iter().enumerate())
        .flat_map(|(component, own)| (0..own.blocks.len()).map(move |block| (component, block)))
        .filter(has_own_x_e)
        .collect();
    let repeated: Vec<BlockIndex> = blocks.iter().flat_map(|block| [*block; PLACES_ALONG_X_E]).collect();
    let mut subproblems = BlockSubproblems::new(&session, fit, &equations, &repeated);
    let mut start = subproblems.start.clone();
    for (subproblem, (component, block)) in repeated.iter().enumerate() {
        let own = &fit.parameterisation.components[*component];
        let Some(trial) = own.trials_of_block(*block).next() else { continue };
        let restart = (x_e_fraction(subproblem % PLACES_ALONG_X_E), DECREMENT_RATIO.0);
        for (parameter, value) in fit.restart_values(&session, trial, restart) {
            let coordinate = fit.coordinate_of(*component, *block, parameter);
            let Some(position) = own.blocks[*block].iter().position(|index| Some(*index) == coordinate)
            else {
                continue;
            };
            let place = subproblems.ranges[subproblem].start + position;
            let bounds = &mut subproblems.parameterisation.coordinates[place];
            start[place] = libm::log(value).clamp(bounds.low, bounds.high);
            if parameter == X_E {
                (bounds.low, bounds.high) = (start[place], start[place]);
            }
        }
    }
    let at = subproblems.solve(&subproblems.parameterisation, &start, PLACE_OPTIONS).coordinates;
    let derivatives = subproblems.whitened_derivatives(&at);
    let places = |(number, block): (usize, &BlockIndex)| {
        let own = &fit.parameterisation.components[block.0];
        let x_e = fit.coordinate_of(block.0, block.1, X_E);
        let x_e = own.blocks[block.1].iter().position(|index| Some(*index) == x_e).unwrap_or(0);
        let these = number * PLACES_ALONG_X_E..(number + 1) * PLACES_ALONG_X_E;
        let place = |subproblem: usize| {
            let range = subproblems.ranges[subproblem].clone();
            let coordinates = &subproblems.parameterisation.coordinates[range.clone()];
            ProfilePoint::new(at[range].to_vec(), coordinates, &derivatives[subproblem])
        };
        let columns: Vec<_> = derivatives[these.clone()].iter().flat_map(|own| own.column_iter()).collect();
        BlockPlaces {
            block: *block,
            trials: own.trials_of_block(block.1).collect(),
            x_e,
            places: these.map(place).collect(),
            derivatives: DMatrix::from_columns(&columns),
        }
    };
    blocks.iter().enumerate().map(places).collect()
}

/// x_e of a place as a fraction of the largest motor angle: steps of the square root, since x_e is better known where it is small.
fn x_e_fraction(place: usize) -> f64 {
    let [least, greatest] = PLACE_FRACTIONS.map(libm::sqrt);
    let root = least + (greatest - least) * place as f64 / (PLACES_ALONG_X_E - 1) as f64;
    root * root
}

impl BlockPlaces {
    /// Where descents of the block start, in the order of the block, then of the border: the places of lowest predicted cost, at most `most`.
    /// Those on both sides of the present optimum at `log_x_e` belong to it, unless their cost is below the `present` one.
    fn promising(
        &self,
        log_x_e: f64,
        [present, most]: [f64; 2],
        others: &BorderPrior,
        noise: &[DVector<f64>],
    ) -> Vec<Vec<f64>> {
        let noise: Vec<f64> = self.trials.iter().flat_map(|trial| noise[*trial].iter()).copied().collect();
        let noise = DVector::from_vec(noise);
        let products = self.derivatives.tr_mul(&noise);
        let of_noise = 0.5 * noise.norm_squared();
        let columns = self.derivatives.ncols() / self.places.len();
        let best: Vec<(f64, DVector<f64>)> = (self.places.iter().enumerate())
            .map(|(place, own)| {
                own.best(self.x_e, others, &products.as_slice()[place * columns..(place + 1) * columns])
            })
            .collect();
        let cost = |place: usize| best.get(place).map_or(f64::INFINITY, |(cost, _)| cost + of_noise);
        let is_lowest =
            |place: usize| cost(place) < cost(place + 1) && (place == 0 || cost(place) <= cost(place - 1));
        let after = self.places.iter().take_while(|own| own.coordinates[self.x_e] < log_x_e).count();
        let is_promising = |place: usize| {
            let belongs = place == after || place + 1 == after;
            is_lowest(place) && cost(place) < if belongs { present } else { most }
        };
        let start = |place: usize| {
            let steps = best[place].1.iter().map(|step| step.clamp(-LARGEST_PLACE_STEP, LARGEST_PLACE_STEP));
            self.places[place].coordinates.iter().zip(steps).map(|(value, step)| value + step).collect()
        };
        (0..best.len()).filter(|place| is_promising(*place)).map(start).collect()
    }
}

impl ProfilePoint {
    /// The place at `at`, where the block has these whitened `derivatives` and, in their last column, residuals.
    fn new(at: Vec<f64>, coordinates: &[Coordinate], derivatives: &DMatrix<f64>) -> Self {
        let (jacobian, residual) = (derivatives.columns(0, at.len()), derivatives.column(at.len()));
        let mut matrix = jacobian.tr_mul(&jacobian);
        let mut gradient = jacobian.tr_mul(&residual);
        let mut cost = 0.5 * residual.norm_squared();
        for (position, (value, coordinate)) in at.iter().zip(coordinates).enumerate() {
            let Some((mean, sd)) = coordinate.prior else { continue };
            let deviation = (value - mean) / sd;
            cost += 0.5 * deviation * deviation;
            gradient[position] += deviation / sd;
            matrix[(position, position)] += 1.0 / (sd * sd);
        }
        Self { coordinates: at, cost, gradient, matrix }
    }

    /// The least cost that the quadratic model predicts with x_e held, less half the square of the noise; and the step there. `products` are
    /// those of the noise with the derivatives and the residual, `others` what the other blocks know about the border.
    fn best(&self, x_e: usize, others: &BorderPrior, products: &[f64]) -> (f64, DVector<f64>) {
        let (size, border) = (self.coordinates.len(), self.coordinates.len() - others.at.len());
        let mut right = DVector::from_fn(size, |position, _| products[position] - self.gradient[position]);
        let deviation = DVector::from_column_slice(&self.coordinates[border..]) - &others.at;
        let slope = &others.information * &deviation;
        let cost = self.cost - products[size] + others.gradient.dot(&deviation) + 0.5 * slope.dot(&deviation);
        let mut of_border = right.rows_mut(border, size - border);
        of_border -= &others.gradient + slope;
        let mut matrix = self.matrix.clone();
        let mut of_border = matrix.view_mut((border, border), others.information.shape());
        of_border += &others.information;
        for position in 0..size {
            matrix[(position, position)] =
                matrix[(position, position)] * (1.0 + PLACE_DAMPING) + f64::MIN_POSITIVE;
        }
        matrix.row_mut(x_e).fill(0.0);
        matrix.column_mut(x_e).fill(0.0);
        (matrix[(x_e, x_e)], right[x_e]) = (1.0, 0.0);
        let Some(factor) = cholesky(matrix) else { return (f64::INFINITY, right) };
        let step = factor.solve(&right);
        (cost - 0.5 * right.dot(&step), step)
    }
}
