//! A second look at yields that may lie elsewhere: a trial's cost can have several minima along its elastic limit.
//!
//! Starting every trial anew from several places finds them and costs five fits. Most trials need none of it: with the
//! elastic limit held elsewhere, one linear step of the other parameters tells that nothing there comes near. Only the
//! blocks of trials that are in doubt are started again.

use super::layout::{Layout, Link};
use super::model::Scope;
use super::normal::{Normal, Objective, evaluate};
use super::prepare::Prepared;
use super::run::{ELASTIC_LIMIT, Fit};
use super::solve::{Effort, Outcome, Solution, solve};

/// Elastic limits that are looked at, as parts of the way that the motor goes in the window.
const PLACES: [f64; 4] = [0.25, 0.4, 0.55, 0.75];

/// A change of log x_e that makes another optimum.
const ELSEWHERE: f64 = 0.25;

/// Two optima closer than this in half the sum of squares, in units of the noise, are not told apart (95 % of chi-square
/// with one degree of freedom).
const NOT_TOLD_APART: f64 = 1.92;

/// A place that the linear step leaves this much worse, in the same units, is not started from.
const OUT_OF_REACH: f64 = 12.0;

/// About how many independent values the paper's filter leaves in its window of 40 ms.
const INDEPENDENT_VALUES: f64 = 4.5;

/// Elastic limits that all trials of a component are started from together.
const TOGETHER: [f64; 2] = [0.4, 0.6];

/// A second look need only tell whether it leads to another optimum.
const LOOK: Effort = Effort { iterations: 25, decrease: 1e-4, longest_step: 0.7 };

/// A block of trials: index of its component, and of the block in it.
type Place = (usize, usize);

impl Fit {
    /// Looks for other optima along the elastic limits, gives each block of trials the best that was found, and notes the
    /// trials whose optima the data do not tell apart.
    pub fn look_again(&mut self, prepared: &Prepared) {
        let treatment = &self.model.base[ELASTIC_LIMIT];
        if !matches!(treatment.scope, Scope::Trial | Scope::Condition) || !treatment.law.is_empty() {
            return;
        }
        self.look_together(prepared);
        let reached = self.normals(prepared, &self.solution.coordinates);
        let mut merged = self.solution.coordinates.clone();
        let mut best: Vec<Vec<f64>> = reached.iter().map(|normal| normal.block_costs().collect()).collect();
        let mut improved = vec![false; self.layout.components.len()];
        let mut several = Vec::new();
        for place in PLACES {
            let (doubtful, start) = self.doubtful(prepared, place, &reached);
            if doubtful.is_empty() {
                continue;
            }
            let found = self.start_again(prepared, &doubtful, &start);
            let normals = self.normals(prepared, &found);
            for (component, block) in doubtful {
                let cost = normals[component].block_costs().nth(block).unwrap_or(f64::INFINITY);
                let unit = self.unit(prepared, component, block, &reached[component]);
                let first = reached[component].block_costs().nth(block).unwrap_or(f64::INFINITY);
                let coordinates = &self.layout.components[component].blocks[block];
                let limit = self.limit_of(component, block);
                let moved = limit
                    .is_some_and(|limit| (found[limit] - self.solution.coordinates[limit]).abs() > ELSEWHERE);
                if moved && (cost - first).abs() < NOT_TOLD_APART * unit {
                    several.extend(self.layout.components[component].trials_of_block(block));
                }
                if cost < best[component][block] - 1e-3 * unit {
                    best[component][block] = cost;
                    improved[component] = true;
                    coordinates.iter().for_each(|index| merged[*index] = found[*index]);
                }
            }
        }
        self.polish(prepared, &improved, &merged);
        several.sort_unstable();
        several.dedup();
        self.several = several;
        self.take_parameters();
    }

    /// Starts all trials of a component anew at once: with what they share at a wrong value, none of them gets to the right
    /// place alone.
    fn look_together(&mut self, prepared: &Prepared) {
        for place in TOGETHER {
            let mut start = self.solution.coordinates.clone();
            for (trial, links) in self.layout.links.iter().enumerate() {
                if let Link::Logarithmic { coordinate, .. } = links[ELASTIC_LIMIT] {
                    let bounds = &self.layout.coordinates[coordinate];
                    let there = libm::log(place * prepared.reach_rad(trial));
                    start[coordinate] = there.clamp(bounds.low, bounds.high);
                }
            }
            let found = solve(prepared, &self.layout, &self.kinds, &self.objective, &start, LOOK);
            let better = |(found, reached): (&Outcome, &Outcome)| found.cost < reached.cost;
            let improved: Vec<bool> =
                found.outcomes.iter().zip(&self.solution.outcomes).map(better).collect();
            self.polish(prepared, &improved, &found.coordinates);
        }
    }

    /// The blocks that may have an optimum about `place`, and a start with their elastic limits there.
    fn doubtful(&self, prepared: &Prepared, place: f64, reached: &[Normal]) -> (Vec<Place>, Vec<f64>) {
        let now = &self.solution.coordinates;
        let mut start = now.clone();
        for (trial, links) in self.layout.links.iter().enumerate() {
            if let Link::Logarithmic { coordinate, .. } = links[ELASTIC_LIMIT] {
                let bounds = &self.layout.coordinates[coordinate];
                let there = libm::log(place * prepared.reach_rad(trial));
                start[coordinate] = there.clamp(bounds.low, bounds.high);
            }
        }
        let normals = self.normals(prepared, &start);
        let mut doubtful = Vec::new();
        for (component, own) in self.layout.components.iter().enumerate() {
            for (block, coordinates) in own.blocks.iter().enumerate() {
                let Some(limit) = self.limit_of(component, block) else { continue };
                let held: Vec<bool> = coordinates.iter().map(|index| *index == limit).collect();
                let promised = normals[component].promised_block_cost(block, &held);
                let first = reached[component].block_costs().nth(block).unwrap_or(f64::INFINITY);
                let unit = self.unit(prepared, component, block, &reached[component]);
                if (start[limit] - now[limit]).abs() > ELSEWHERE && promised < first + OUT_OF_REACH * unit {
                    doubtful.push((component, block));
                } else {
                    coordinates.iter().for_each(|index| start[*index] = now[*index]);
                }
            }
        }
        (doubtful, start)
    }

    /// Solves the components of the doubtful blocks from `start`.
    fn start_again(&self, prepared: &Prepared, doubtful: &[Place], start: &[f64]) -> Vec<f64> {
        let some = |component: usize| doubtful.iter().any(|(own, _)| *own == component);
        self.solve_some(prepared, &some, start, LOOK).coordinates
    }

    /// Goes on from the merged best blocks where any improved, and keeps what is better as a whole.
    fn polish(&mut self, prepared: &Prepared, improved: &[bool], merged: &[f64]) {
        if !improved.contains(&true) {
            return;
        }
        let polished = self.solve_some(prepared, &|component| improved[component], merged, Effort::default());
        let solved = (0..improved.len()).filter(|component| improved[*component]);
        for (component, outcome) in solved.zip(polished.outcomes) {
            if outcome.cost < self.solution.outcomes[component].cost {
                for coordinate in self.layout.components[component].order() {
                    self.solution.coordinates[coordinate] = polished.coordinates[coordinate];
                }
                self.solution.outcomes[component] = outcome;
            }
        }
    }

    fn solve_some(
        &self,
        prepared: &Prepared,
        some: &dyn Fn(usize) -> bool,
        start: &[f64],
        effort: Effort,
    ) -> Solution {
        let components = self.layout.components.iter().enumerate();
        let part = Layout {
            components: components.filter(|(index, _)| some(*index)).map(|(_, own)| own.clone()).collect(),
            ..self.layout.clone()
        };
        solve(prepared, &part, &self.kinds, &self.objective, start, effort)
    }

    fn normals(&self, prepared: &Prepared, coordinates: &[f64]) -> Vec<Normal> {
        let components: Vec<_> = self.layout.components.iter().collect();
        evaluate(prepared, &self.layout, &self.kinds, &self.objective, &components, coordinates)
    }

    /// The coordinate of a block's elastic limit.
    fn limit_of(&self, component: usize, block: usize) -> Option<usize> {
        let coordinates = &self.layout.components[component].blocks[block];
        coordinates.iter().copied().find(|index| self.layout.coordinates[*index].parameter == ELASTIC_LIMIT)
    }

    /// What half a squared residual of one standard deviation is worth in a block's cost: one where the noise weighs it, else
    /// estimated from what is left.
    fn unit(&self, prepared: &Prepared, component: usize, block: usize, reached: &Normal) -> f64 {
        match self.objective {
            Objective::Whitened(_) => 1.0,
            Objective::LeastSquares => {
                let windows = prepared.samples as f64 * prepared.period_s / 0.040;
                let trials = self.layout.components[component].trials_of_block(block).count() as f64;
                reached.block_costs().nth(block).unwrap_or(0.0)
                    / (trials * 0.5 * INDEPENDENT_VALUES * windows)
            }
        }
    }
}
