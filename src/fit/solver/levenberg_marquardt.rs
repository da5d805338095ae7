//! Bounded Levenberg-Marquardt method with block-wise damping; all components of a session are solved side by side.

use nalgebra::DVector;

use super::normal_equations::{GaussNewtonEquations, evaluate};
use super::options::SolverOptions;
use super::step_control::StepControl;
use crate::fit::data::observations::Observations;
use crate::fit::parameters::component::Component;
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::residuals::objective::Objective;
use crate::wrist::mechanisms::MechanismKind;

/// Reason why an optimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// No step predicts a notable decrease of the cost, or several steps together brought none.
    Converged,
    /// The last steps changed nothing, though the gradient is not zero: the problem is flat or singular there.
    Stalled,
    /// The largest number of iterations was reached.
    Iterations,
    /// The model gives no finite torque at the start.
    NotFinite,
}

/// Result of the optimisation of one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentOutcome {
    /// Half the sum of squared residuals, priors included.
    pub cost: f64,
    /// Reason why the optimisation ended.
    pub termination: Termination,
    /// Number of evaluations of the normal equations.
    pub iterations: usize,
}

/// Result of an optimisation.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The coordinates at the optimum.
    pub coordinates: Vec<f64>,
    /// One result per component.
    pub outcomes: Vec<ComponentOutcome>,
}

impl Solution {
    /// Cost of all components: half the sum of squared residuals, priors included.
    pub fn cost(&self) -> f64 {
        self.outcomes.iter().map(|outcome| outcome.cost).sum()
    }
}

/// Number of accepted steps after which the total decrease of the cost is checked.
const PROGRESS_STEPS: usize = 8;

/// Decrease of the cost over these steps, in units of [`SolverOptions::tolerance`], below which the optimisation has converged.
const PROGRESS_TOLERANCE: f64 = 300.0;

/// Damping factor above which no step is possible.
const MAX_DAMPING: f64 = 1e12;

/// Minimises the objective over the coordinates from `start`, within their bounds.
pub fn solve(
    observations: &Observations,
    parameterisation: &Parameterisation,
    kinds: &[MechanismKind],
    objective: &Objective,
    start: &[f64],
    options: SolverOptions,
) -> Solution {
    let mut coordinates = start.to_vec();
    let mut solvers: Vec<ComponentSolver> =
        parameterisation.components.iter().map(|own| ComponentSolver::new(own, options)).collect();
    loop {
        let active: Vec<usize> = (0..solvers.len()).filter(|i| solvers[*i].outcome.is_none()).collect();
        if active.is_empty() {
            break;
        }
        let mut candidate = coordinates.clone();
        for index in &active {
            for (coordinate, value) in &solvers[*index].candidate {
                candidate[*coordinate] = *value;
            }
        }
        let components: Vec<&Component> = active.iter().map(|index| solvers[*index].component).collect();
        let evaluated = evaluate(observations, parameterisation, kinds, objective, &components, &candidate);
        for (index, equations) in active.iter().zip(evaluated) {
            solvers[*index].accept_or_reject(parameterisation, &mut coordinates, equations, options);
        }
    }
    let outcomes = solvers.iter().filter_map(|solver| solver.outcome).collect();
    Solution { coordinates, outcomes }
}

/// State of the optimisation of one component.
struct ComponentSolver<'a> {
    component: &'a Component,
    /// Step control of each block, then that of the border.
    controls: Vec<StepControl>,
    /// Cost and normal equations at the accepted point; `None` before the first evaluation.
    accepted: Option<(f64, GaussNewtonEquations)>,
    /// The candidate point: coordinates by index, and their values.
    candidate: Vec<(usize, f64)>,
    /// Decrease of the cost that the quadratic model predicts for the candidate.
    predicted: f64,
    /// The same for the trials of each block.
    predicted_by_block: Vec<f64>,
    /// Number of consecutive accepted steps with a negligible decrease.
    small_steps: usize,
    /// Number of accepted steps since the last check of progress.
    steps_since_check: usize,
    /// Cost at the last check of progress.
    cost_at_check: f64,
    iterations: usize,
    outcome: Option<ComponentOutcome>,
}

impl<'a> ComponentSolver<'a> {
    fn new(component: &'a Component, options: SolverOptions) -> Self {
        Self {
            component,
            controls: vec![StepControl::new(options); component.blocks.len() + 1],
            accepted: None,
            candidate: Vec::new(),
            predicted: 0.0,
            predicted_by_block: Vec::new(),
            small_steps: 0,
            steps_since_check: 0,
            cost_at_check: f64::INFINITY,
            iterations: 0,
            outcome: None,
        }
    }

    /// Accepts or rejects the candidate, at which `equations` were evaluated, and proposes the next one.
    fn accept_or_reject(
        &mut self,
        parameterisation: &Parameterisation,
        coordinates: &mut [f64],
        equations: GaussNewtonEquations,
        options: SolverOptions,
    ) {
        self.iterations += 1;
        let cost = equations.cost;
        match &self.accepted {
            None if !cost.is_finite() => return self.end(Termination::NotFinite, f64::INFINITY),
            None => self.accepted = Some((cost, equations)),
            Some((before, at)) => {
                let before = *before;
                let decrease = before - cost;
                let block_decreases: Vec<f64> =
                    at.block_costs().zip(equations.block_costs()).map(|(before, now)| before - now).collect();
                if decrease > 0.0 && cost.is_finite() {
                    for (coordinate, value) in &self.candidate {
                        coordinates[*coordinate] = *value;
                    }
                    self.update_controls(&block_decreases, decrease, options);
                    self.accepted = Some((cost, equations));
                    let small = decrease <= options.tolerance * cost
                        && self.predicted <= 10.0 * options.tolerance * cost;
                    self.small_steps = if small { self.small_steps + 1 } else { 0 };
                    if self.small_steps >= 2 || self.progress_is_negligible(cost, options) {
                        return self.end(Termination::Converged, cost);
                    }
                } else {
                    if self.predicted <= options.tolerance * before {
                        return self.end(Termination::Converged, before);
                    }
                    self.update_controls(&block_decreases, decrease, options);
                    if self.largest_damping() > MAX_DAMPING {
                        return self.end(Termination::Stalled, before);
                    }
                }
            }
        }
        let cost = self.accepted.as_ref().map_or(f64::INFINITY, |(cost, _)| *cost);
        if self.iterations >= options.max_iterations {
            return self.end(Termination::Iterations, cost);
        }
        self.propose(parameterisation, coordinates);
        // With strong damping, a small predicted decrease does not mean that the optimum is near.
        let factor = if self.largest_damping() <= 1e-2 { 1.0 } else { 1e-3 };
        if self.predicted <= factor * options.tolerance * cost {
            self.end(Termination::Converged, cost);
        }
    }

    fn end(&mut self, termination: Termination, cost: f64) {
        self.outcome = Some(ComponentOutcome { cost, termination, iterations: self.iterations });
    }

    fn largest_damping(&self) -> f64 {
        self.controls.iter().map(|control| control.damping).fold(0.0, f64::max)
    }

    /// Adapts the step control of each block to the actual decrease of its cost, and that of the border to the total `decrease`.
    fn update_controls(&mut self, block_decreases: &[f64], decrease: f64, options: SolverOptions) {
        let accepted = decrease > 0.0;
        let notable = 1e-3 * self.predicted.abs();
        let mut any_failed = false;
        let blocks = self.controls.iter_mut().zip(block_decreases).zip(&self.predicted_by_block);
        for ((control, actual), predicted) in blocks {
            // A block may get a predicted increase, because the border moves for the sake of others. A failure is an increase that
            // the quadratic model did not predict.
            if *actual < 0.0 && actual - predicted < -0.75 * predicted.abs().max(notable) || actual.is_nan() {
                control.after_failure(options);
                any_failed = true;
            } else if *predicted <= notable {
                control.after_negligible_step();
            } else if accepted {
                control.after_success(actual / predicted, options);
            }
        }
        let Some((border, blocks)) = self.controls.split_last_mut() else { return };
        if accepted {
            border.after_success(decrease / self.predicted.max(f64::MIN_POSITIVE), options);
        } else {
            border.after_failure(options);
            if !any_failed {
                blocks.iter_mut().for_each(|control| control.after_failure(options));
            }
        }
    }

    /// Whether the last [`PROGRESS_STEPS`] steps together brought next to nothing. In a flat, curved valley each step predicts more than
    /// it brings, and hundreds of steps follow that no data can distinguish.
    fn progress_is_negligible(&mut self, cost: f64, options: SolverOptions) -> bool {
        self.steps_since_check += 1;
        if self.steps_since_check < PROGRESS_STEPS {
            return false;
        }
        let negligible = self.cost_at_check - cost <= PROGRESS_TOLERANCE * options.tolerance * cost;
        (self.steps_since_check, self.cost_at_check) = (0, cost);
        negligible
    }

    /// Proposes the next candidate: a damped Gauss-Newton step within the bounds. The damping grows until the quadratic model predicts
    /// a decrease.
    fn propose(&mut self, parameterisation: &Parameterisation, coordinates: &[f64]) {
        let Some((_, equations)) = &self.accepted else { return };
        let component = self.component;
        let order = component.order();
        let gradient = equations.gradient(component);
        // A coordinate at a bound stays there if the descent direction leaves the bounds.
        let held: Vec<bool> = order
            .iter()
            .zip(gradient.iter())
            .map(|(index, slope)| {
                let (c, x) = (&parameterisation.coordinates[*index], coordinates[*index]);
                let edge = 1e-9 * c.scale.abs().max(1e-9);
                (x <= c.low + edge && *slope > 0.0) || (x >= c.high - edge && *slope < 0.0)
            })
            .collect();
        let lengths = component.blocks.iter().map(Vec::len).chain([component.border.len()]);
        let max_log_steps: Vec<f64> = (self.controls.iter().zip(lengths))
            .flat_map(|(control, length)| std::iter::repeat_n(control.max_log_step, length))
            .collect();
        loop {
            let dampings: Vec<f64> = self.controls.iter().map(|control| control.damping).collect();
            if let Some(step) = equations.damped_step(component, parameterisation, &dampings, &held) {
                // Coordinates are limited one by one, so that one with little influence does not shorten the step of the others. If
                // the limited step predicts an increase, the whole step is shortened instead.
                let limited =
                    |limit| limited_step(parameterisation, &order, coordinates, &step, &max_log_steps, limit);
                let mut taken = limited(Limit::EachCoordinate);
                self.predicted = equations.predicted_decrease(component, &gradient, &taken);
                if self.predicted <= 0.0 {
                    taken = limited(Limit::WholeStep);
                    self.predicted = equations.predicted_decrease(component, &gradient, &taken);
                }
                // A step cut at the bounds may predict an increase; a shorter one, closer to the gradient, does not.
                if self.predicted > 0.0 || self.largest_damping() > MAX_DAMPING {
                    self.predicted_by_block = equations.predicted_by_block(&taken);
                    self.candidate.clear();
                    self.candidate.extend(
                        order.iter().zip(&taken).map(|(index, by)| (*index, coordinates[*index] + by)),
                    );
                    return;
                }
            } else if self.largest_damping() > MAX_DAMPING {
                self.predicted = 0.0;
                return;
            }
            self.controls.iter_mut().for_each(|own| own.damping = (own.damping * 10.0).max(1e-10));
        }
    }
}

/// How a step is limited to the largest steps of logarithmic coordinates.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Limit {
    /// Each coordinate is cut at its own limit.
    EachCoordinate,
    /// The whole step is shortened, so that its direction stays.
    WholeStep,
}

/// Limits `step` to the largest steps of logarithmic coordinates, then cuts it at the bounds.
fn limited_step(
    parameterisation: &Parameterisation,
    order: &[usize],
    coordinates: &[f64],
    step: &DVector<f64>,
    max_log_steps: &[f64],
    limit: Limit,
) -> DVector<f64> {
    let most = |position: usize| {
        let logarithmic = parameterisation.coordinates[order[position]].logarithmic;
        if logarithmic { max_log_steps[position] } else { f64::INFINITY }
    };
    let excess = (0..order.len()).map(|position| step[position].abs() / most(position)).fold(1.0, f64::max);
    let shorten = if limit == Limit::WholeStep { 1.0 / excess } else { 1.0 };
    DVector::from_fn(order.len(), |position, _| {
        let (c, x) = (&parameterisation.coordinates[order[position]], coordinates[order[position]]);
        let by = (shorten * step[position]).clamp(-most(position), most(position));
        (x + by).clamp(c.low, c.high) - x
    })
}
