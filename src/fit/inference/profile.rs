//! Profile likelihood intervals: how far a parameter can be moved, all others following, before the noise can't account
//! for what the fit loses.
//!
//! The elastic limit and the decrement beyond it act on the last milliseconds of a window only, and the likelihood is not a
//! parabola about them: an interval from the curvature at the optimum is too short on one side. Each trial's profile is a
//! small problem of its own, its block and the border; what the other blocks know of the border goes into it as the
//! quadratic that is left when they are eliminated. All profiles of a session descend side by side.

use std::ops::Range;

use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::{Fit, X_E};
use crate::fit::parameters::parameterisation::{Component, Coordinate, Transform};
use crate::fit::solver::levenberg_marquardt::SolverOptions;
use crate::fit::solver::normal_equations::{NormalEquations, Objective, evaluate};

/// The parameters that have a profile: k_dec and x_e.
pub const PROFILED_PARAMETERS: [usize; 2] = [4, X_E];

/// Fall of twice the log likelihood at the ends of a 95 % interval: chi-square with one degree of freedom.
const FALL: f64 = 3.841_458_820_694_124;

/// The interval's ends are found to this part of the fall's root.
const EXACT: f64 = 0.01;

/// How many times an end is sought anew.
const ROUNDS: usize = 8;

/// A profile starts at its neighbour's end; few steps lead down.
const STEPS: SolverOptions = SolverOptions { max_iterations: 12, tolerance: 1e-5, max_log_step: 0.7 };

/// The 95 % interval of one parameter of a trial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ProfileInterval {
    /// Lower end; `None` where the fit may go to its bound without a loss that the noise could not make.
    pub low: Option<f64>,
    /// Upper end, likewise.
    pub high: Option<f64>,
}

/// One end that is sought.
struct IntervalEnd {
    component: usize,
    block: usize,
    coordinate: usize,
    upwards: bool,
    optimum: f64,
    /// Where the profile is evaluated next, and the points that enclose the end: place and root of the fall.
    at: f64,
    inside: (f64, f64),
    outside: Option<(f64, f64)>,
    found: Option<Option<f64>>,
}

/// The intervals of every trial's [`PROFILED_PARAMETERS`] parameters; `None` where a parameter is not a coordinate of its own block, or
/// where no measured noise says what a loss is worth.
pub fn profiles(observations: &Observations, fit: &Fit) -> Vec<[Option<ProfileInterval>; 2]> {
    let none = vec![[None; 2]; observations.trials.len()];
    if !matches!(fit.objective, Objective::Whitened(_)) {
        return none;
    }
    let components: Vec<&Component> = fit.parameterisation.components.iter().collect();
    let at = &fit.solution.coordinates;
    let normals = evaluate(observations, &fit.parameterisation, &fit.kinds, &fit.objective, &components, at);
    let mut ends = ends(fit, &normals);
    if ends.is_empty() {
        return none;
    }
    let problems = ProfileProblems::new(observations, fit, &normals, &ends);
    problems.seek(&mut ends);
    let end_of = |trial: usize, parameter: usize, upwards: bool| {
        let Transform::Logarithmic { coordinate, factor } = fit.parameterisation.transforms[trial][parameter]
        else {
            return None;
        };
        let end = ends.iter().find(|end| end.coordinate == coordinate && end.upwards == upwards)?;
        Some(end.found.flatten().map(|place| factor * libm::exp(place)))
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

/// Both ends of each coordinate that has a profile; first sought where the curvature at the optimum puts them.
fn ends(fit: &Fit, normals: &[NormalEquations]) -> Vec<IntervalEnd> {
    let mut ends = Vec::new();
    for (component, own) in fit.parameterisation.components.iter().enumerate() {
        for (block, coordinates) in own.blocks.iter().enumerate() {
            let known = normals[component].border_prior_from_others(own, block, &fit.solution.coordinates);
            let sds = normals[component].block_standard_deviations(block, &known);
            for (place, coordinate) in coordinates.iter().enumerate() {
                let bounds = &fit.parameterisation.coordinates[*coordinate];
                if !bounds.logarithmic || !PROFILED_PARAMETERS.contains(&bounds.parameter) {
                    continue;
                }
                let now = fit.solution.coordinates[*coordinate];
                let step = libm::sqrt(FALL) * sds[place].clamp(1e-4, 0.5);
                for upwards in [false, true] {
                    let first =
                        if upwards { (now + step).min(bounds.high) } else { (now - step).max(bounds.low) };
                    ends.push(IntervalEnd {
                        component,
                        block,
                        coordinate: *coordinate,
                        upwards,
                        optimum: now,
                        at: first,
                        inside: (now, 0.0),
                        outside: None,
                        found: ((first - now).abs() < 1e-9).then_some(None),
                    });
                }
            }
        }
    }
    ends
}

/// One small problem an end.
struct ProfileProblems<'a> {
    alone: BlockSubproblems<'a>,
    /// For each end, its coordinate in them, and the cost at the optimum.
    target: Vec<usize>,
    least: Vec<f64>,
}

impl<'a> ProfileProblems<'a> {
    fn new(
        observations: &Observations,
        fit: &'a Fit,
        normals: &[NormalEquations],
        ends: &[IntervalEnd],
    ) -> Self {
        let places: Vec<BlockIndex> = ends.iter().map(|end| (end.component, end.block)).collect();
        let alone = BlockSubproblems::new(observations, fit, normals, &places);
        let target = |(end, range): (&IntervalEnd, &Range<usize>)| {
            let block = &fit.parameterisation.components[end.component].blocks[end.block];
            range.start + block.iter().position(|index| *index == end.coordinate).unwrap_or(0)
        };
        Self {
            target: ends.iter().zip(&alone.ranges).map(target).collect(),
            least: alone.normals(&alone.start).iter().map(|normal| normal.cost).collect(),
            alone,
        }
    }

    /// Seeks all ends, by the secant of the root of the fall, which is nearly straight.
    fn seek(&self, ends: &mut [IntervalEnd]) {
        let mut reached = self.alone.start.clone();
        for _ in 0..ROUNDS {
            let sought: Vec<usize> = (0..ends.len()).filter(|index| ends[*index].found.is_none()).collect();
            if sought.is_empty() {
                return;
            }
            let mut parameterisation = self.alone.subset(&sought);
            let mut start = reached.clone();
            for index in &sought {
                let (target, at) = (self.target[*index], ends[*index].at);
                (parameterisation.coordinates[target].low, parameterisation.coordinates[target].high) =
                    (at, at);
                start[target] = at;
            }
            let solution = self.alone.solve(&parameterisation, &start, STEPS);
            for (index, outcome) in sought.iter().zip(&solution.outcomes) {
                let range = self.alone.ranges[*index].clone();
                reached[range.clone()].copy_from_slice(&solution.coordinates[range]);
                let fall = 2.0 * (outcome.cost - self.least[*index]).max(0.0);
                ends[*index].accept_or_reject(
                    &self.alone.parameterisation.coordinates[self.target[*index]],
                    libm::sqrt(fall),
                );
            }
        }
        // What is still open lies between two known points: the straight line between them is near enough.
        for end in ends.iter_mut().filter(|end| end.found.is_none()) {
            end.found = Some(end.outside.map(|_| end.at));
        }
    }
}

impl IntervalEnd {
    /// Takes the root of the fall at the present place, and chooses the next.
    fn accept_or_reject(&mut self, bounds: &Coordinate, root: f64) {
        let wanted = libm::sqrt(FALL);
        let bound = if self.upwards { bounds.high } else { bounds.low };
        if (root - wanted).abs() <= EXACT * wanted {
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
        let (near, near_root) = self.inside;
        self.at = match self.outside {
            Some((far, far_root)) => {
                let part = ((wanted - near_root) / (far_root - near_root)).clamp(0.1, 0.9);
                near + part * (far - near)
            }
            None => {
                let further = (wanted / near_root.max(0.25)).clamp(1.1, 3.0) * (near - self.optimum);
                let next = self.optimum + further;
                if self.upwards { next.min(bound) } else { next.max(bound) }
            }
        };
    }
}
