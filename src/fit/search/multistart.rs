//! A second look at yields that may lie restart_point: a trial's cost can have ambiguous_trials minima along its elastic limit.
//!
//! So every block of trials is started again, alone, from places that have nothing to do with where the fit ended. Most
//! need not go far: with the elastic limit held there, one linear step of the other parameters tells that nothing comes near.

use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::{Fit, K_DEC, K_SRS, X_E};
use crate::fit::model::specification::Scope;
use crate::fit::parameters::parameterisation::{Parameterisation, Transform};
use crate::fit::solver::levenberg_marquardt::{ComponentOutcome, Solution, SolverOptions, solve};
use crate::fit::solver::normal_equations::{NormalEquations, Objective, evaluate};

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
const LOOK: SolverOptions = SolverOptions { max_iterations: 25, tolerance: 1e-4, max_log_step: 0.7 };

/// The plain sum of squares has valleys so flat that a short look does not tell.
const PLAIN_LOOK: SolverOptions = SolverOptions { max_iterations: 60, tolerance: 1e-6, max_log_step: 0.7 };

/// A block's optimum about another place.
struct AlternativeOptimum {
    place: BlockIndex,
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
    pub fn search_multistart(&mut self, observations: &Observations) {
        if self.x_e_is_local() {
            self.restart_all_trials(observations);
            self.restart_blocks(observations);
        }
    }

    /// This fit made anew on another session of the same trials, such as one drawn from it.
    pub fn refitted(&self, session: &Observations) -> Self {
        let (parameterisation, start) = (&self.parameterisation, &self.solution.coordinates);
        let solution =
            solve(session, parameterisation, &self.kinds, &self.objective, start, SolverOptions::default());
        let mut fit = self.at_solution(solution);
        if fit.x_e_is_local() {
            // What the trials share is nearly right, so they need not be started together.
            fit.restart_blocks(session);
        }
        fit
    }

    fn look(&self) -> SolverOptions {
        match self.objective {
            Objective::Whitened(_) => LOOK,
            Objective::LeastSquares => PLAIN_LOOK,
        }
    }

    fn x_e_is_local(&self) -> bool {
        let treatment = &self.model.base[X_E];
        matches!(treatment.scope, Scope::Trial | Scope::Condition) && treatment.law.is_empty()
    }

    fn restart_blocks(&mut self, observations: &Observations) {
        let mut ambiguous_trials = vec![Vec::new(); self.parameterisation.components.len()];
        let mut open = vec![true; self.parameterisation.components.len()];
        for _ in 0..ROUNDS {
            let alternatives = self.alternatives(observations, &open);
            self.mark_ambiguous_trials(&alternatives, &open, &mut ambiguous_trials);
            open = self.adopt_best(observations, &alternatives);
            if !open.contains(&true) {
                break;
            }
        }
        self.ambiguous_trials = ambiguous_trials.concat();
        self.ambiguous_trials.sort_unstable();
        self.update_parameters();
    }

    /// Where the blocks of the open components get to, alone, from every place that is not out of reach.
    fn alternatives(&self, observations: &Observations, open: &[bool]) -> Vec<AlternativeOptimum> {
        let reached = self.normals(observations, &self.solution.coordinates);
        let mut places = Vec::new();
        for (component, own) in self.parameterisation.components.iter().enumerate() {
            for block in 0..own.blocks.len() {
                if open[component] && self.coordinate_of(component, block, X_E).is_some() {
                    places.extend([(component, block); PLACES.len()]);
                }
            }
        }
        let alone = BlockSubproblems::new(observations, self, &reached, &places);
        let start = self.starts(observations, &alone, &places);
        let first = |place: &BlockIndex| reached[place.0].block_costs().nth(place.1).unwrap_or(f64::INFINITY);
        let unit = |place: &BlockIndex| self.unit(observations, place.0, place.1, &reached[place.0]);
        let normals = alone.normals(&start);
        let in_reach: Vec<usize> = (0..places.len())
            .filter(|problem| {
                let place = &places[*problem];
                let own = &self.parameterisation.components[place.0].blocks[place.1];
                let limit = self.coordinate_of(place.0, place.1, X_E);
                let held: Vec<bool> = own.iter().map(|index| Some(*index) == limit).collect();
                let promised = normals[*problem].predicted_block_cost(0, &held);
                promised < first(place) + OUT_OF_REACH * unit(place)
            })
            .collect();
        let solution = alone.solve(&alone.subset(&in_reach), &start, self.look());
        let rival = |(problem, outcome): (&usize, &ComponentOutcome)| {
            let (place, range) = (places[*problem], alone.ranges[*problem].clone());
            let own = &self.parameterisation.components[place.0].blocks[place.1];
            let coordinates = solution.coordinates[range][..own.len()].to_vec();
            let limit = self.coordinate_of(place.0, place.1, X_E);
            let at = own.iter().position(|index| Some(*index) == limit).unwrap_or(0);
            let away = (coordinates[at] - self.solution.coordinates[own[at]]).abs();
            AlternativeOptimum {
                place,
                better_by: (first(&place) - outcome.cost) / unit(&place),
                away,
                coordinates,
            }
        };
        in_reach.iter().zip(&solution.outcomes).map(rival).collect()
    }

    /// The starts of all problems: the block as it is, but for x_e and k_dec.
    fn starts(
        &self,
        observations: &Observations,
        alone: &BlockSubproblems,
        places: &[BlockIndex],
    ) -> Vec<f64> {
        let mut start = alone.start.clone();
        for (problem, place) in places.iter().enumerate() {
            let component = &self.parameterisation.components[place.0];
            let Some(trial) = component.trials_of_block(place.1).next() else { continue };
            for (parameter, value) in self.restart_point(observations, trial, PLACES[problem % PLACES.len()])
            {
                let Some(coordinate) = self.coordinate_of(place.0, place.1, parameter) else { continue };
                let own = &component.blocks[place.1];
                let at = alone.ranges[problem].start
                    + own.iter().position(|index| *index == coordinate).unwrap_or(0);
                let bounds = &alone.parameterisation.coordinates[at];
                start[at] = libm::log(value).clamp(bounds.low, bounds.high);
            }
        }
        start
    }

    /// A trial's k_srs, k_dec and x_e at a place. What the window's end shows stays: the mean stiffness up to there.
    fn restart_point(
        &self,
        observations: &Observations,
        trial: usize,
        (limit, decrement): (f64, f64),
    ) -> [(usize, f64); 3] {
        let (own, reach) = (&self.parameters[trial], observations.peak_angle_rad(trial));
        let mean = own[K_SRS] - own[K_DEC] * (1.0 - own[X_E] / reach).max(0.0);
        let stiffness = mean.max(0.2 * own[K_SRS]) / (1.0 - decrement * (1.0 - limit));
        [(K_SRS, stiffness), (K_DEC, decrement * stiffness), (X_E, limit * reach)]
    }

    /// The trials of each open component that have another optimum which the data do not tell apart from their best.
    fn mark_ambiguous_trials(
        &self,
        alternatives: &[AlternativeOptimum],
        open: &[bool],
        ambiguous_trials: &mut [Vec<usize>],
    ) {
        (0..open.len())
            .filter(|component| open[*component])
            .for_each(|component| ambiguous_trials[component].clear());
        let best = |place: BlockIndex| {
            let own = alternatives.iter().filter(|rival| rival.place == place);
            own.map(|rival| rival.better_by).fold(0.0, f64::max)
        };
        let equals = |rival: &&AlternativeOptimum| {
            rival.away > ELSEWHERE && rival.better_by > best(rival.place) - NOT_TOLD_APART
        };
        for (component, block) in alternatives.iter().filter(equals).map(|rival| rival.place) {
            let trials = self.parameterisation.components[component].trials_of_block(block);
            let fresh: Vec<usize> =
                trials.filter(|trial| !ambiguous_trials[component].contains(trial)).collect();
            ambiguous_trials[component].extend(fresh);
        }
    }

    /// Goes on from the best alternatives; the components that have any.
    fn adopt_best(&mut self, observations: &Observations, alternatives: &[AlternativeOptimum]) -> Vec<bool> {
        let mut merged = self.solution.coordinates.clone();
        let mut improved = vec![false; self.parameterisation.components.len()];
        let mut best: Vec<&AlternativeOptimum> =
            alternatives.iter().filter(|rival| rival.better_by > WORTH).collect();
        // The best of each block comes last.
        best.sort_by(|a, b| a.better_by.total_cmp(&b.better_by));
        for rival in best {
            let (component, block) = rival.place;
            improved[component] = true;
            for (index, value) in
                self.parameterisation.components[component].blocks[block].iter().zip(&rival.coordinates)
            {
                merged[*index] = *value;
            }
        }
        self.optimise_from(observations, &improved, &merged);
        improved
    }

    /// Starts all trials of a component anew at once: with what they share at a wrong value, none of them gets to the right
    /// place alone.
    pub(in crate::fit) fn restart_all_trials(&mut self, observations: &Observations) {
        for place in TOGETHER {
            let mut start = self.solution.coordinates.clone();
            for (trial, links) in self.parameterisation.transforms.iter().enumerate() {
                for (parameter, value) in self.restart_point(observations, trial, place) {
                    if let Transform::Logarithmic { coordinate, factor } = links[parameter] {
                        let bounds = &self.parameterisation.coordinates[coordinate];
                        start[coordinate] = libm::log(value / factor).clamp(bounds.low, bounds.high);
                    }
                }
            }
            let found = solve(
                observations,
                &self.parameterisation,
                &self.kinds,
                &self.objective,
                &start,
                self.look(),
            );
            let better = |(found, reached): (&ComponentOutcome, &ComponentOutcome)| found.cost < reached.cost;
            let improved: Vec<bool> =
                found.outcomes.iter().zip(&self.solution.outcomes).map(better).collect();
            self.optimise_from(observations, &improved, &found.coordinates);
        }
    }

    /// Goes on from the merged best blocks where any improved, and keeps what is better as a whole.
    fn optimise_from(&mut self, observations: &Observations, improved: &[bool], merged: &[f64]) {
        if !improved.contains(&true) {
            return;
        }
        let polished = self.solve_components(
            observations,
            &|component| improved[component],
            merged,
            SolverOptions::default(),
        );
        let solved = (0..improved.len()).filter(|component| improved[*component]);
        for (component, outcome) in solved.zip(polished.outcomes) {
            if outcome.cost < self.solution.outcomes[component].cost {
                for coordinate in self.parameterisation.components[component].order() {
                    self.solution.coordinates[coordinate] = polished.coordinates[coordinate];
                }
                self.solution.outcomes[component] = outcome;
            }
        }
    }

    fn solve_components(
        &self,
        observations: &Observations,
        some: &dyn Fn(usize) -> bool,
        start: &[f64],
        options: SolverOptions,
    ) -> Solution {
        let components = self.parameterisation.components.iter().enumerate();
        let part = Parameterisation {
            components: components.filter(|(index, _)| some(*index)).map(|(_, own)| own.clone()).collect(),
            ..self.parameterisation.clone()
        };
        solve(observations, &part, &self.kinds, &self.objective, start, options)
    }

    fn normals(&self, observations: &Observations, coordinates: &[f64]) -> Vec<NormalEquations> {
        let components: Vec<_> = self.parameterisation.components.iter().collect();
        evaluate(observations, &self.parameterisation, &self.kinds, &self.objective, &components, coordinates)
    }

    /// The coordinate of a block that is the logarithm of a base parameter.
    fn coordinate_of(&self, component: usize, block: usize, parameter: usize) -> Option<usize> {
        let coordinates = &self.parameterisation.components[component].blocks[block];
        let is_it = |index: &usize| {
            let own = &self.parameterisation.coordinates[*index];
            own.parameter == parameter && own.logarithmic
        };
        coordinates.iter().copied().find(is_it)
    }

    /// What half a squared residual of one standard deviation is worth in a block's cost: one where the noise weighs it, else
    /// estimated from what is left.
    fn unit(
        &self,
        observations: &Observations,
        component: usize,
        block: usize,
        reached: &NormalEquations,
    ) -> f64 {
        match self.objective {
            Objective::Whitened(_) => 1.0,
            Objective::LeastSquares => {
                let windows = observations.samples as f64 * observations.period_s / 0.040;
                let trials =
                    self.parameterisation.components[component].trials_of_block(block).count() as f64;
                reached.block_costs().nth(block).unwrap_or(0.0)
                    / (trials * 0.5 * INDEPENDENT_VALUES * windows)
            }
        }
    }
}
