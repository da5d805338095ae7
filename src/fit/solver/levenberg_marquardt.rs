//! Bounded Levenberg-Marquardt on arrowhead normal equations, all separate problems of a session side by side.

use nalgebra::{DMatrix, DVector};

use super::normal_equations::{NormalEquations, Objective};
use crate::fit::data::preprocessing::Observations;
use crate::fit::parameters::parameterisation::{Component, Parameterisation};
use crate::wrist::mechanisms::MechanismKind;

/// Why an optimisation ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Termination {
    /// No step promises a notable decrease of the cost, or ambiguous_trials together brought none.
    Converged,
    /// The last steps changed nothing, though the gradient is not zero: the problem is flat or singular there.
    Stalled,
    /// The number of iterations allowed was used up.
    Iterations,
    /// The model cannot be evaluated at the start.
    NotFinite,
}

/// Limits of the optimisation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SolverOptions {
    /// Largest number of evaluations of the normal equations.
    pub max_iterations: usize,
    /// Decrease of the cost, relative to the cost, below which another step is not worth its time.
    pub tolerance: f64,
    /// Largest step of a logarithmic coordinate.
    pub max_log_step: f64,
}

impl Default for SolverOptions {
    fn default() -> Self {
        Self { max_iterations: 100, tolerance: 1e-6, max_log_step: 0.7 }
    }
}

/// After so many steps the descent is looked back upon.
const VALLEY_STEPS: usize = 8;

/// The decrease of the cost over these steps, in units of [`SolverOptions::tolerance`], below which the valley is flat.
const VALLEY_DECREASE: f64 = 300.0;

/// What came out for one component.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ComponentOutcome {
    /// Half the sum of squared residuals.
    pub cost: f64,
    /// Why it ended.
    pub stop: Termination,
    /// How many steps were tried.
    pub iterations: usize,
}

/// A solved parameterisation.
#[derive(Debug, Clone)]
pub struct Solution {
    /// The coordinates at the optimum.
    pub coordinates: Vec<f64>,
    /// One outcome a component.
    pub outcomes: Vec<ComponentOutcome>,
}

impl Solution {
    /// Half the sum of squares of all components, what is known beforehand included.
    pub fn cost(&self) -> f64 {
        self.outcomes.iter().map(|outcome| outcome.cost).sum()
    }
}

/// How far one block dares to go. What the blocks share with the border apart, they are problems of their own: where one
/// trial's valley bends, only that trial is held back.
#[derive(Debug, Clone, Copy)]
struct StepControl {
    damping: f64,
    growth: f64,
    /// Longest step of its logarithmic coordinates.
    longest: f64,
}

impl StepControl {
    /// After a step that brought `gain` times what it promised.
    fn after_gain(&mut self, gain: f64, options: SolverOptions) {
        let excess = 2.0 * gain - 1.0;
        self.damping = (self.damping * (1.0 - excess * excess * excess).clamp(0.1, 2.0)).max(1e-12);
        self.growth = 2.0;
        if gain > 0.75 {
            self.longest = (2.0 * self.longest).min(4.0 * options.max_log_step);
        }
    }

    /// After a step that had nothing at stake.
    fn recover(&mut self) {
        (self.damping, self.growth) = ((0.3 * self.damping).max(1e-12), 2.0);
    }

    /// After a step that led up, or not down as promised.
    fn after_failure(&mut self, options: SolverOptions) {
        self.damping *= self.growth;
        self.growth *= 2.0;
        self.longest = (0.5 * self.longest).min(options.max_log_step);
    }
}

/// One component on its way down.
struct ComponentSolver<'a> {
    component: &'a Component,
    /// One stride a block, the border's last.
    strides: Vec<StepControl>,
    /// Each block's part in what is promised.
    predicted_by_block: Vec<f64>,
    /// The point reached, its cost and normal equations.
    reached: Option<(f64, NormalEquations)>,
    trial_point: Vec<(usize, f64)>,
    /// Decrease of the cost that the quadratic model promises for the trial point.
    promised: f64,
    small_steps: usize,
    /// Steps taken since `milestone` was passed, the cost of then.
    since: usize,
    milestone: f64,
    outcome: Option<ComponentOutcome>,
    iterations: usize,
}

/// Minimises the objective over the parameterisation's coordinates from `start`.
pub fn solve(
    observations: &Observations,
    parameterisation: &Parameterisation,
    kinds: &[MechanismKind],
    objective: &Objective,
    start: &[f64],
    options: SolverOptions,
) -> Solution {
    let mut coordinates = start.to_vec();
    let mut descents: Vec<ComponentSolver> =
        parameterisation.components.iter().map(|own| ComponentSolver::new(own, options)).collect();
    loop {
        let active: Vec<usize> = (0..descents.len()).filter(|i| descents[*i].outcome.is_none()).collect();
        if active.is_empty() {
            break;
        }
        let mut candidate = coordinates.clone();
        for index in &active {
            for (coordinate, value) in &descents[*index].trial_point {
                candidate[*coordinate] = *value;
            }
        }
        let components: Vec<&Component> = active.iter().map(|index| descents[*index].component).collect();
        let evaluated = super::normal_equations::evaluate(
            observations,
            parameterisation,
            kinds,
            objective,
            &components,
            &candidate,
        );
        for (index, normal) in active.iter().zip(evaluated) {
            descents[*index].accept_or_reject(parameterisation, &mut coordinates, normal, options);
        }
    }
    let outcomes = descents.iter().filter_map(|descent| descent.outcome).collect();
    Solution { coordinates, outcomes }
}

impl<'a> ComponentSolver<'a> {
    fn new(component: &'a Component, options: SolverOptions) -> Self {
        let stride = StepControl { damping: 1e-2, growth: 2.0, longest: options.max_log_step };
        Self {
            component,
            strides: vec![stride; component.blocks.len() + 1],
            predicted_by_block: Vec::new(),
            reached: None,
            trial_point: Vec::new(),
            promised: 0.0,
            small_steps: 0,
            since: 0,
            milestone: f64::INFINITY,
            outcome: None,
            iterations: 0,
        }
    }

    /// Takes or refuses the point just evaluated, and chooses the next.
    fn accept_or_reject(
        &mut self,
        parameterisation: &Parameterisation,
        coordinates: &mut [f64],
        normal: NormalEquations,
        options: SolverOptions,
    ) {
        self.iterations += 1;
        let cost = normal.cost;
        match &self.reached {
            None if !cost.is_finite() => return self.end(Termination::NotFinite, f64::INFINITY),
            None => self.reached = Some((cost, normal)),
            Some((before, at)) => {
                let before = *before;
                let decrease = before - cost;
                let gains: Vec<f64> =
                    at.block_costs().zip(normal.block_costs()).map(|(before, now)| before - now).collect();
                if decrease > 0.0 && cost.is_finite() {
                    for (coordinate, value) in &self.trial_point {
                        coordinates[*coordinate] = *value;
                    }
                    self.update_dampings(&gains, decrease, options);
                    self.reached = Some((cost, normal));
                    let small = decrease <= options.tolerance * cost
                        && self.promised <= 10.0 * options.tolerance * cost;
                    self.small_steps = if small { self.small_steps + 1 } else { 0 };
                    if self.small_steps >= 2 || self.progress_is_negligible(cost, options) {
                        return self.end(Termination::Converged, cost);
                    }
                } else {
                    if self.promised <= options.tolerance * before {
                        return self.end(Termination::Converged, before);
                    }
                    self.update_dampings(&gains, decrease, options);
                    if self.largest_damping() > 1e12 {
                        return self.end(Termination::Stalled, before);
                    }
                }
            }
        }
        let cost = self.reached.as_ref().map_or(f64::INFINITY, |(cost, _)| *cost);
        if self.iterations >= options.max_iterations {
            return self.end(Termination::Iterations, cost);
        }
        self.propose_step(parameterisation, coordinates);
        let cautious = if self.largest_damping() <= 1e-2 { 1.0 } else { 1e-3 };
        if self.promised <= cautious * options.tolerance * cost {
            self.end(Termination::Converged, cost);
        }
    }

    fn largest_damping(&self) -> f64 {
        self.strides.iter().map(|stride| stride.damping).fold(0.0, f64::max)
    }

    /// Fits the strides to what the last step brought, block by block.
    fn update_dampings(&mut self, gains: &[f64], decrease: f64, options: SolverOptions) {
        let taken = decrease > 0.0;
        let notable = 1e-3 * self.promised.abs();
        let mut blamed = false;
        for ((stride, gain), promised) in self.strides.iter_mut().zip(gains).zip(&self.predicted_by_block) {
            // A block may be promised a loss where the border moves for the others; only what the model did not foresee counts.
            if *gain < 0.0 && gain - promised < -0.75 * promised.abs().max(notable) || gain.is_nan() {
                stride.after_failure(options);
                blamed = true;
            } else if *promised <= notable {
                stride.recover();
            } else if taken {
                stride.after_gain(gain / promised, options);
            }
        }
        let Some((border, blocks)) = self.strides.split_last_mut() else { return };
        if taken {
            border.after_gain(decrease / self.promised.max(f64::MIN_POSITIVE), options);
        } else {
            border.after_failure(options);
            if !blamed {
                blocks.iter_mut().for_each(|stride| stride.after_failure(options));
            }
        }
    }

    /// Whether the last steps together brought next to nothing: in a flat, curved valley each step promises more than it
    /// keeps, and the way goes on for hundreds of steps that no data can tell apart.
    fn progress_is_negligible(&mut self, cost: f64, options: SolverOptions) -> bool {
        self.since += 1;
        if self.since < VALLEY_STEPS {
            return false;
        }
        let flat = self.milestone - cost <= VALLEY_DECREASE * options.tolerance * cost;
        (self.since, self.milestone) = (0, cost);
        flat
    }

    fn end(&mut self, stop: Termination, cost: f64) {
        self.outcome = Some(ComponentOutcome { cost, stop, iterations: self.iterations });
    }

    /// The next point: a damped Gauss-Newton step within the bounds.
    fn propose_step(&mut self, parameterisation: &Parameterisation, coordinates: &[f64]) {
        let Some((_, normal)) = &self.reached else { return };
        let order = self.component.order();
        let gradient = normal.gradient(self.component);
        // A coordinate at a bound that the gradient pushes against stays there.
        let held: Vec<bool> = order
            .iter()
            .zip(gradient.iter())
            .map(|(index, slope)| {
                let (c, x) = (&parameterisation.coordinates[*index], coordinates[*index]);
                let edge = 1e-9 * c.scale.abs().max(1e-9);
                (x <= c.low + edge && *slope > 0.0) || (x >= c.high - edge && *slope < 0.0)
            })
            .collect();
        let component = self.component;
        let lengths = component.blocks.iter().map(Vec::len).chain([component.border.len()]);
        let longest: Vec<f64> = (self.strides.iter().zip(lengths))
            .flat_map(|(stride, length)| std::iter::repeat_n(stride.longest, length))
            .collect();
        loop {
            let dampings: Vec<f64> = self.strides.iter().map(|stride| stride.damping).collect();
            if let Some(step) = normal.damped_step(component, parameterisation, &dampings, &held) {
                // Cut off one by one, so that a coordinate that hardly matters does not hold up the others; if that leads
                // up, shortened as a whole.
                let mut taken = within_bounds(parameterisation, &order, coordinates, &step, &longest, false);
                self.promised = normal.predicted_decrease(component, &gradient, &taken);
                if self.promised <= 0.0 {
                    taken = within_bounds(parameterisation, &order, coordinates, &step, &longest, true);
                    self.promised = normal.predicted_decrease(component, &gradient, &taken);
                }
                // A step cut off at the bounds may lead up; a shorter one, more along the gradient, does not.
                if self.promised > 0.0 || self.largest_damping() > 1e12 {
                    self.predicted_by_block = normal.predicted_by_block(&taken);
                    self.trial_point.clear();
                    self.trial_point.extend(
                        order.iter().zip(&taken).map(|(index, by)| (*index, coordinates[*index] + by)),
                    );
                    return;
                }
            } else if self.largest_damping() > 1e12 {
                self.promised = 0.0;
                return;
            }
            self.strides.iter_mut().for_each(|own| own.damping = (own.damping * 10.0).max(1e-10));
        }
    }
}

/// The step with no logarithmic coordinate going further than its `longest`, by shortening it as a whole or by cutting each off;
/// then cut off at the bounds.
fn within_bounds(
    parameterisation: &Parameterisation,
    order: &[usize],
    coordinates: &[f64],
    step: &DVector<f64>,
    longest: &[f64],
    as_a_whole: bool,
) -> DVector<f64> {
    let most = |place: usize| {
        if parameterisation.coordinates[order[place]].logarithmic { longest[place] } else { f64::INFINITY }
    };
    let excess = (0..order.len()).map(|place| step[place].abs() / most(place)).fold(1.0, f64::max);
    let shorten = if as_a_whole { 1.0 / excess } else { 1.0 };
    DVector::from_fn(order.len(), |place, _| {
        let (c, x) = (&parameterisation.coordinates[order[place]], coordinates[order[place]]);
        let by = (shorten * step[place]).clamp(-most(place), most(place));
        (x + by).clamp(c.low, c.high) - x
    })
}

impl Component {
    /// Its coordinates in the order of the solver: block by block, then the border.
    pub fn order(&self) -> Vec<usize> {
        self.blocks.iter().flatten().chain(&self.border).copied().collect()
    }
}

/// The Cholesky factor of a small matrix; `None` if it is not positive definite.
pub(in crate::fit) fn factor(matrix: DMatrix<f64>) -> Option<nalgebra::Cholesky<f64, nalgebra::Dyn>> {
    nalgebra::Cholesky::new(matrix)
}
