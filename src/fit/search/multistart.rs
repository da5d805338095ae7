//! A second look at yields that may lie elsewhere: a trial's cost can have several minima along its elastic limit.
//!
//! So every block of trials is started again, alone, from places that have nothing to do with where the fit ended. Most
//! need not go far: with the elastic limit held there, one linear step of the other parameters tells that nothing comes near.

use crate::fit::data::preprocessing::Prepared;
use crate::fit::fitted::block_subproblem::{Alone, Place};
use crate::fit::fitted::fit::{DECREMENT, ELASTIC_LIMIT, Fit, STIFFNESS};
use crate::fit::model::specification::Scope;
use crate::fit::parameters::parameterisation::{Layout, Link};
use crate::fit::solver::levenberg_marquardt::{Effort, Outcome, Solution, solve};
use crate::fit::solver::normal_equations::{Normal, Objective, evaluate};

/// Where blocks start again: the elastic limit as a part of the way that the motor goes in the window, and k_dec as a part of
/// k_srs.
const PLACES: [(f64, f64); 8] =
    [(0.1, 0.6), (0.2, 0.6), (0.2, 0.9), (0.35, 0.3), (0.35, 0.6), (0.5, 0.6), (0.7, 0.6), (0.85, 0.6)];

/// Most times that the blocks are looked at: with another place for one, the border moves, and with it the others.
const ROUNDS: usize = 5;

/// A decrease of a block's cost that is worth another place, in units of the noise.
const WORTH: f64 = 3e-3;

/// A change of log x_e that makes another optimum.
const ELSEWHERE: f64 = 0.25;

/// Two optima closer than this in half the sum of squares, in units of the noise, are not told apart (95 % of chi-square
/// with one degree of freedom).
const NOT_TOLD_APART: f64 = 1.92;

/// A place that the linear step leaves this much worse, in the same units, is not started from.
const OUT_OF_REACH: f64 = 12.0;

/// About how many independent values the paper's filter leaves in its window of 40 ms.
const INDEPENDENT_VALUES: f64 = 4.5;

/// Places that all trials of a component are started from together.
const TOGETHER: [(f64, f64); 2] = [(0.4, 0.6), (0.6, 0.6)];

/// A second look need only tell whether it leads to another optimum.
const LOOK: Effort = Effort { iterations: 25, decrease: 1e-4, longest_step: 0.7 };

/// The plain sum of squares has valleys so flat that a short look does not tell.
const PLAIN_LOOK: Effort = Effort { iterations: 60, decrease: 1e-6, longest_step: 0.7 };

/// A block's optimum about another place.
struct Rival {
    place: Place,
    /// What the block's cost falls by, in units of the noise, the other blocks following.
    better_by: f64,
    /// How far its log x_e lies from that of the fit.
    away: f64,
    /// The block's coordinates there.
    coordinates: Vec<f64>,
}

impl Fit {
    /// Looks for other optima along the elastic limits, gives each block of trials the best that was found, and notes the
    /// trials whose optima the data do not tell apart.
    pub fn look_again(&mut self, prepared: &Prepared) {
        if self.has_own_limits() {
            self.look_together(prepared);
            self.look_at_blocks(prepared);
        }
    }

    /// This fit made anew on another session of the same trials, such as one drawn from it.
    pub fn refitted(&self, session: &Prepared) -> Self {
        let (layout, start) = (&self.layout, &self.solution.coordinates);
        let solution = solve(session, layout, &self.kinds, &self.objective, start, Effort::default());
        let mut fit = self.with_solution(solution);
        if fit.has_own_limits() {
            // What the trials share is nearly right, so they need not be started together.
            fit.look_at_blocks(session);
        }
        fit
    }

    fn look(&self) -> Effort {
        match self.objective {
            Objective::Whitened(_) => LOOK,
            Objective::LeastSquares => PLAIN_LOOK,
        }
    }

    fn has_own_limits(&self) -> bool {
        let treatment = &self.model.base[ELASTIC_LIMIT];
        matches!(treatment.scope, Scope::Trial | Scope::Condition) && treatment.law.is_empty()
    }

    fn look_at_blocks(&mut self, prepared: &Prepared) {
        let mut several = vec![Vec::new(); self.layout.components.len()];
        let mut open = vec![true; self.layout.components.len()];
        for _ in 0..ROUNDS {
            let rivals = self.rivals(prepared, &open);
            self.note_several(&rivals, &open, &mut several);
            open = self.take_best(prepared, &rivals);
            if !open.contains(&true) {
                break;
            }
        }
        self.several = several.concat();
        self.several.sort_unstable();
        self.take_parameters();
    }

    /// Where the blocks of the open components get to, alone, from every place that is not out of reach.
    fn rivals(&self, prepared: &Prepared, open: &[bool]) -> Vec<Rival> {
        let reached = self.normals(prepared, &self.solution.coordinates);
        let mut places = Vec::new();
        for (component, own) in self.layout.components.iter().enumerate() {
            for block in 0..own.blocks.len() {
                if open[component] && self.coordinate_of(component, block, ELASTIC_LIMIT).is_some() {
                    places.extend([(component, block); PLACES.len()]);
                }
            }
        }
        let alone = Alone::new(prepared, self, &reached, &places);
        let start = self.starts(prepared, &alone, &places);
        let first = |place: &Place| reached[place.0].block_costs().nth(place.1).unwrap_or(f64::INFINITY);
        let unit = |place: &Place| self.unit(prepared, place.0, place.1, &reached[place.0]);
        let normals = alone.normals(&start);
        let in_reach: Vec<usize> = (0..places.len())
            .filter(|problem| {
                let place = &places[*problem];
                let own = &self.layout.components[place.0].blocks[place.1];
                let limit = self.coordinate_of(place.0, place.1, ELASTIC_LIMIT);
                let held: Vec<bool> = own.iter().map(|index| Some(*index) == limit).collect();
                let promised = normals[*problem].promised_block_cost(0, &held);
                promised < first(place) + OUT_OF_REACH * unit(place)
            })
            .collect();
        let solution = alone.solve(&alone.only(&in_reach), &start, self.look());
        let rival = |(problem, outcome): (&usize, &Outcome)| {
            let (place, range) = (places[*problem], alone.ranges[*problem].clone());
            let own = &self.layout.components[place.0].blocks[place.1];
            let coordinates = solution.coordinates[range][..own.len()].to_vec();
            let limit = self.coordinate_of(place.0, place.1, ELASTIC_LIMIT);
            let at = own.iter().position(|index| Some(*index) == limit).unwrap_or(0);
            let away = (coordinates[at] - self.solution.coordinates[own[at]]).abs();
            Rival { place, better_by: (first(&place) - outcome.cost) / unit(&place), away, coordinates }
        };
        in_reach.iter().zip(&solution.outcomes).map(rival).collect()
    }

    /// The starts of all problems: the block as it is, but for x_e and k_dec.
    fn starts(&self, prepared: &Prepared, alone: &Alone, places: &[Place]) -> Vec<f64> {
        let mut start = alone.start.clone();
        for (problem, place) in places.iter().enumerate() {
            let component = &self.layout.components[place.0];
            let Some(trial) = component.trials_of_block(place.1).next() else { continue };
            for (parameter, value) in self.elsewhere(prepared, trial, PLACES[problem % PLACES.len()]) {
                let Some(coordinate) = self.coordinate_of(place.0, place.1, parameter) else { continue };
                let own = &component.blocks[place.1];
                let at = alone.ranges[problem].start
                    + own.iter().position(|index| *index == coordinate).unwrap_or(0);
                let bounds = &alone.layout.coordinates[at];
                start[at] = libm::log(value).clamp(bounds.low, bounds.high);
            }
        }
        start
    }

    /// A trial's k_srs, k_dec and x_e at a place. What the window's end shows stays: the mean stiffness up to there.
    fn elsewhere(
        &self,
        prepared: &Prepared,
        trial: usize,
        (limit, decrement): (f64, f64),
    ) -> [(usize, f64); 3] {
        let (own, reach) = (&self.parameters[trial], prepared.reach_rad(trial));
        let mean = own[STIFFNESS] - own[DECREMENT] * (1.0 - own[ELASTIC_LIMIT] / reach).max(0.0);
        let stiffness = mean.max(0.2 * own[STIFFNESS]) / (1.0 - decrement * (1.0 - limit));
        [(STIFFNESS, stiffness), (DECREMENT, decrement * stiffness), (ELASTIC_LIMIT, limit * reach)]
    }

    /// The trials of each open component that have another optimum which the data do not tell apart from their best.
    fn note_several(&self, rivals: &[Rival], open: &[bool], several: &mut [Vec<usize>]) {
        (0..open.len()).filter(|component| open[*component]).for_each(|component| several[component].clear());
        let best = |place: Place| {
            let own = rivals.iter().filter(|rival| rival.place == place);
            own.map(|rival| rival.better_by).fold(0.0, f64::max)
        };
        let equals =
            |rival: &&Rival| rival.away > ELSEWHERE && rival.better_by > best(rival.place) - NOT_TOLD_APART;
        for (component, block) in rivals.iter().filter(equals).map(|rival| rival.place) {
            let trials = self.layout.components[component].trials_of_block(block);
            let fresh: Vec<usize> = trials.filter(|trial| !several[component].contains(trial)).collect();
            several[component].extend(fresh);
        }
    }

    /// Goes on from the best rivals; the components that have any.
    fn take_best(&mut self, prepared: &Prepared, rivals: &[Rival]) -> Vec<bool> {
        let mut merged = self.solution.coordinates.clone();
        let mut improved = vec![false; self.layout.components.len()];
        let mut best: Vec<&Rival> = rivals.iter().filter(|rival| rival.better_by > WORTH).collect();
        // The best of each block comes last.
        best.sort_by(|a, b| a.better_by.total_cmp(&b.better_by));
        for rival in best {
            let (component, block) = rival.place;
            improved[component] = true;
            for (index, value) in
                self.layout.components[component].blocks[block].iter().zip(&rival.coordinates)
            {
                merged[*index] = *value;
            }
        }
        self.polish(prepared, &improved, &merged);
        improved
    }

    /// Starts all trials of a component anew at once: with what they share at a wrong value, none of them gets to the right
    /// place alone.
    pub(in crate::fit) fn look_together(&mut self, prepared: &Prepared) {
        for place in TOGETHER {
            let mut start = self.solution.coordinates.clone();
            for (trial, links) in self.layout.links.iter().enumerate() {
                for (parameter, value) in self.elsewhere(prepared, trial, place) {
                    if let Link::Logarithmic { coordinate, factor } = links[parameter] {
                        let bounds = &self.layout.coordinates[coordinate];
                        start[coordinate] = libm::log(value / factor).clamp(bounds.low, bounds.high);
                    }
                }
            }
            let found = solve(prepared, &self.layout, &self.kinds, &self.objective, &start, self.look());
            let better = |(found, reached): (&Outcome, &Outcome)| found.cost < reached.cost;
            let improved: Vec<bool> =
                found.outcomes.iter().zip(&self.solution.outcomes).map(better).collect();
            self.polish(prepared, &improved, &found.coordinates);
        }
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

    /// The coordinate of a block that is the logarithm of a base parameter.
    fn coordinate_of(&self, component: usize, block: usize, parameter: usize) -> Option<usize> {
        let coordinates = &self.layout.components[component].blocks[block];
        let is_it = |index: &usize| {
            let own = &self.layout.coordinates[*index];
            own.parameter == parameter && own.logarithmic
        };
        coordinates.iter().copied().find(is_it)
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
