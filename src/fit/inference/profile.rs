//! Profile likelihood intervals: how far a parameter can move, all others re-estimated, until the cost increases significantly.
//!
//! x_e and k_dec affect only the last milliseconds of a window, and the log likelihood is not a parabola over them: an interval from the
//! curvature at the optimum would be too short on one side. Each profile is a block subproblem, and all profiles of a session are
//! computed side by side.

use std::ops::Range;

use crate::fit::data::observations::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::Fit;
use crate::fit::model::parameter_index::{K_DEC, X_E};
use crate::fit::parameters::component::Component;
use crate::fit::parameters::coordinate::{Coordinate, Transform};
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::normal_equations::{GaussNewtonEquations, evaluate};
use crate::fit::solver::options::SolverOptions;

/// Indices of the parameters that have a profile.
pub const PROFILED_PARAMETERS: [usize; 2] = [K_DEC, X_E];

/// Decrease of twice the log likelihood at the ends of a 95 % interval: the 95 % quantile of chi-square with one degree of freedom.
const CHI_SQUARE_95: f64 = 3.841_458_820_694_124;

/// Accuracy of the ends, relative to the square root of [`CHI_SQUARE_95`].
const END_TOLERANCE: f64 = 0.01;

/// Largest number of secant steps for an end.
const MAX_SECANT_STEPS: usize = 8;

/// Options of the solver at a point of a profile, which starts at the solution of the point before.
const PROFILE_POINT: SolverOptions = SolverOptions { max_iterations: 12, tolerance: 1e-5, max_log_step: 0.7 };

/// 95 % profile likelihood interval of one parameter of a trial, in the unit of the parameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileInterval {
    /// Lower end; `None` if the cost does not increase significantly up to the bound.
    pub low: Option<f64>,
    /// Upper end; `None` if the cost does not increase significantly up to the bound.
    pub high: Option<f64>,
}

/// Profile likelihood intervals of the [`PROFILED_PARAMETERS`] of every trial. `None` for a parameter that is not a coordinate of its
/// own block, and for unweighted fits, for which no noise says which increase of the cost is significant.
pub fn profiles(observations: &Observations, fit: &Fit) -> Vec<[Option<ProfileInterval>; 2]> {
    let none = vec![[None; 2]; observations.trials.len()];
    if !matches!(fit.objective, Objective::Whitened(_)) {
        return none;
    }
    let components: Vec<&Component> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    let equations =
        evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at);
    let mut ends = interval_ends(fit, &equations);
    if ends.is_empty() {
        return none;
    }
    ProfileProblems::new(observations, fit, &equations, &ends).find(&mut ends);
    let end_of = |trial: usize, parameter: usize, upper: bool| {
        let Transform::Logarithmic { coordinate, factor } = fit.parameterisation.transforms[trial][parameter]
        else {
            return None;
        };
        let end = ends.iter().find(|end| end.coordinate == coordinate && end.upper == upper)?;
        Some(end.found.flatten().map(|coordinate| factor * libm::exp(coordinate)))
    };
    (0..observations.trials.len())
        .map(|trial| {
            PROFILED_PARAMETERS.map(|parameter| {
                let (low, high) = (end_of(trial, parameter, false)?, end_of(trial, parameter, true)?);
                Some(ProfileInterval { low, high })
            })
        })
        .collect()
}

/// Search for one end of an interval.
struct IntervalEnd {
    component: usize,
    block: usize,
    /// Index of the coordinate.
    coordinate: usize,
    /// Whether this is the upper end.
    upper: bool,
    /// The coordinate at the optimum.
    optimum: f64,
    /// The coordinate at which the profile is evaluated next.
    at: f64,
    /// The last point inside the interval: coordinate, and square root of the decrease of twice the log likelihood.
    inside: (f64, f64),
    /// The last point outside the interval, if any.
    outside: Option<(f64, f64)>,
    /// The end once it is known; `Some(None)` if the interval reaches the bound.
    found: Option<Option<f64>>,
}

/// Both ends of each coordinate that has a profile. The first evaluation is where the curvature at the optimum puts the end.
fn interval_ends(fit: &Fit, equations: &[GaussNewtonEquations]) -> Vec<IntervalEnd> {
    let mut ends = Vec::new();
    for (component, own) in fit.parameterisation.components.iter().enumerate() {
        let priors = equations[component].border_priors_from_others(own, &fit.solution.coordinates);
        for (block, coordinates) in own.blocks.iter().enumerate() {
            let sds = equations[component].block_standard_deviations(block, &priors[block]);
            for (position, coordinate) in coordinates.iter().enumerate() {
                let bounds = &fit.parameterisation.coordinates[*coordinate];
                if !bounds.logarithmic || !PROFILED_PARAMETERS.contains(&bounds.parameter) {
                    continue;
                }
                let optimum = fit.solution.coordinates[*coordinate];
                let step = libm::sqrt(CHI_SQUARE_95) * sds[position].clamp(1e-4, 0.5);
                for upper in [false, true] {
                    let first = if upper {
                        (optimum + step).min(bounds.high)
                    } else {
                        (optimum - step).max(bounds.low)
                    };
                    ends.push(IntervalEnd {
                        component,
                        block,
                        coordinate: *coordinate,
                        upper,
                        optimum,
                        at: first,
                        inside: (optimum, 0.0),
                        outside: None,
                        found: ((first - optimum).abs() < 1e-9).then_some(None),
                    });
                }
            }
        }
    }
    ends
}

/// One block subproblem per interval end.
struct ProfileProblems<'a> {
    subproblems: BlockSubproblems<'a>,
    /// For each end, the index of its coordinate in the subproblems.
    target: Vec<usize>,
    /// For each end, the cost of its subproblem at the optimum.
    optimal_cost: Vec<f64>,
}

impl<'a> ProfileProblems<'a> {
    fn new(
        observations: &Observations,
        fit: &'a Fit,
        equations: &[GaussNewtonEquations],
        ends: &[IntervalEnd],
    ) -> Self {
        let blocks: Vec<BlockIndex> = ends.iter().map(|end| (end.component, end.block)).collect();
        let subproblems = BlockSubproblems::new(observations, fit, equations, &blocks);
        let target = |(end, range): (&IntervalEnd, &Range<usize>)| {
            let block = &fit.parameterisation.components[end.component].blocks[end.block];
            range.start + block.iter().position(|index| *index == end.coordinate).unwrap_or(0)
        };
        let at_optimum = subproblems.normal_equations(&subproblems.start);
        Self {
            target: ends.iter().zip(&subproblems.ranges).map(target).collect(),
            optimal_cost: at_optimum.iter().map(|own| own.cost).collect(),
            subproblems,
        }
    }

    /// Finds all ends by secant steps on the square root of the decrease of twice the log likelihood, which is nearly linear.
    fn find(&self, ends: &mut [IntervalEnd]) {
        let mut coordinates = self.subproblems.start.clone();
        for _ in 0..MAX_SECANT_STEPS {
            let open: Vec<usize> = (0..ends.len()).filter(|index| ends[*index].found.is_none()).collect();
            if open.is_empty() {
                return;
            }
            let mut parameterisation = self.subproblems.subset(&open);
            let mut start = coordinates.clone();
            for index in &open {
                let (target, at) = (self.target[*index], ends[*index].at);
                let coordinate = &mut parameterisation.coordinates[target];
                (coordinate.low, coordinate.high) = (at, at);
                start[target] = at;
            }
            let solution = self.subproblems.solve(&parameterisation, &start, PROFILE_POINT);
            for (index, outcome) in open.iter().zip(&solution.outcomes) {
                let range = self.subproblems.ranges[*index].clone();
                coordinates[range.clone()].copy_from_slice(&solution.coordinates[range]);
                let decrease = 2.0 * (outcome.cost - self.optimal_cost[*index]).max(0.0);
                let bounds = &self.subproblems.parameterisation.coordinates[self.target[*index]];
                ends[*index].update(bounds, libm::sqrt(decrease));
            }
        }
        // An end that is still open lies between two known points, and the last secant step is accurate enough.
        for end in ends.iter_mut().filter(|end| end.found.is_none()) {
            end.found = Some(end.outside.map(|_| end.at));
        }
    }
}

impl IntervalEnd {
    /// Updates the search with the square root of the decrease of twice the log likelihood at the present coordinate.
    fn update(&mut self, bounds: &Coordinate, root: f64) {
        let wanted = libm::sqrt(CHI_SQUARE_95);
        let bound = if self.upper { bounds.high } else { bounds.low };
        if (root - wanted).abs() <= END_TOLERANCE * wanted {
            self.found = Some(Some(self.at));
            return;
        }
        if root < wanted {
            if (self.at - bound).abs() < 1e-9 {
                self.found = Some(None);
                return;
            }
            self.inside = (self.at, root);
        } else {
            self.outside = Some((self.at, root));
        }
        let (inside, inside_root) = self.inside;
        self.at = match self.outside {
            Some((outside, outside_root)) => {
                let fraction = ((wanted - inside_root) / (outside_root - inside_root)).clamp(0.1, 0.9);
                inside + fraction * (outside - inside)
            }
            None => {
                let step = (wanted / inside_root.max(0.25)).clamp(1.1, 3.0) * (inside - self.optimum);
                let next = self.optimum + step;
                if self.upper { next.min(bound) } else { next.max(bound) }
            }
        };
    }
}
