//! Multistart search along the elastic limit: the cost of a trial can have several minima over x_e.
//!
//! Every block is restarted as a subproblem of its own from values of x_e and k_dec that do not depend on where the fit ended. Most
//! restarts are dropped at once: with x_e held, one Gauss-Newton step of the other parameters shows that the cost stays too high.

use crate::fit::data::observations::Observations;
use crate::fit::data::preprocessing::REFLEX_FREE_S;
use crate::fit::fitted::block_subproblem::{BlockIndex, BlockSubproblems};
use crate::fit::fitted::fit::{BlockOptimum, Fit};
use crate::fit::model::parameter_index::{K_DEC, K_SRS, X_E};
use crate::fit::model::specification::Scope;
use crate::fit::parameters::coordinate::Transform;
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::levenberg_marquardt::{ComponentOutcome, Solution, solve};
use crate::fit::solver::normal_equations::{GaussNewtonEquations, evaluate};
use crate::fit::solver::options::SolverOptions;

/// A restart: x_e as a fraction of the largest motor angle in the window, and k_dec as a fraction of k_srs.
pub type Restart = (f64, f64);

/// Restarts of single blocks.
const BLOCK_RESTARTS: [Restart; 8] =
    [(0.1, 0.6), (0.2, 0.6), (0.2, 0.9), (0.35, 0.3), (0.35, 0.6), (0.5, 0.6), (0.7, 0.6), (0.85, 0.6)];

/// Restarts of all trials of a component together.
const COMPONENT_RESTARTS: [Restart; 2] = [(0.4, 0.6), (0.6, 0.6)];

/// Largest number of rounds of block restarts: a block with another optimum moves the border, and with it the other blocks.
pub(super) const MAX_ROUNDS: usize = 5;

/// Smallest decrease of a block's cost, per unit of noise variance, for which another optimum is adopted.
const MIN_BLOCK_DECREASE: f64 = 3e-3;

/// Distance in log x_e from which on an optimum counts as another one.
const DISTINCT_OPTIMUM_LOG_X_E: f64 = 0.25;

/// An optimum is not kept, and a restart is dropped, if the cost (predicted) there exceeds the present one by this, per unit of noise
/// variance: the data speak against it by 24 units of chi-square.
const MAX_EXCESS: f64 = 12.0;

/// Approximate number of independent values that the paper's filter leaves in its window.
const INDEPENDENT_VALUES: f64 = 4.5;

/// Options of a restart with whitened residuals: it must only show whether it leads to another optimum.
const RESTART: SolverOptions = SolverOptions { max_iterations: 25, tolerance: 1e-4, max_log_step: 0.7 };

/// Options of a restart with ordinary least squares, whose valleys are so flat that a short descent shows nothing.
const UNWEIGHTED_RESTART: SolverOptions =
    SolverOptions { max_iterations: 60, tolerance: 1e-6, max_log_step: 0.7 };

/// Optimum of a block that a restart reached.
pub(super) struct AlternativeOptimum {
    block: BlockIndex,
    /// Decrease of the block's cost, per unit of noise variance, if the other blocks follow.
    pub(super) decrease: f64,
    /// log x_e, and its distance from that of the fit.
    log_x_e: f64,
    distance: f64,
    /// Coordinates of the block.
    coordinates: Vec<f64>,
}

impl Fit {
    /// Searches for other optima along x_e, adopts the best optimum of each block, and marks the trials whose optima the data do not
    /// distinguish.
    pub fn search_multistart(&mut self, observations: &Observations) {
        if self.has_local_x_e() {
            self.restart_components(observations);
            self.restart_blocks(observations);
        }
    }

    /// Restarts all trials of each component together: with a wrong value of the parameters that they share, no trial reaches its
    /// right optimum alone.
    pub(super) fn restart_components(&mut self, observations: &Observations) {
        for restart in COMPONENT_RESTARTS {
            let mut start = self.solution.coordinates.clone();
            for (trial, transforms) in self.parameterisation.transforms.iter().enumerate() {
                for (parameter, value) in self.restart_values(observations, trial, restart) {
                    if let Transform::Logarithmic { coordinate, factor } = transforms[parameter] {
                        let bounds = &self.parameterisation.coordinates[coordinate];
                        start[coordinate] = libm::log(value / factor).clamp(bounds.low, bounds.high);
                    }
                }
            }
            let options = self.restart_options();
            let found =
                solve(observations, &self.parameterisation, &self.kinds, &self.objective, &start, options);
            let is_better =
                |(found, present): (&ComponentOutcome, &ComponentOutcome)| found.cost < present.cost;
            let improved: Vec<bool> =
                found.outcomes.iter().zip(&self.solution.outcomes).map(is_better).collect();
            self.adopt_if_better(observations, &improved, &found.coordinates, SolverOptions::default());
        }
    }

    /// Restarts single blocks until no block improves.
    fn restart_blocks(&mut self, observations: &Observations) {
        let components = self.parameterisation.components.len();
        let mut other_optima = vec![Vec::new(); components];
        let mut open = vec![true; components];
        for _ in 0..MAX_ROUNDS {
            let alternatives = self.alternative_optima(observations, &open);
            self.collect_other_optima(&alternatives, &open, &mut other_optima);
            open = self.adopt_best_blocks(observations, &alternatives, SolverOptions::default());
            if !open.contains(&true) {
                break;
            }
        }
        self.other_optima = other_optima.concat();
        self.update_parameters();
    }

    /// The optima that the blocks of the open components reach from the restarts that are not dropped.
    fn alternative_optima(&self, observations: &Observations, open: &[bool]) -> Vec<AlternativeOptimum> {
        let present = self.normal_equations(observations);
        let mut blocks = Vec::new();
        for (component, own) in self.parameterisation.components.iter().enumerate() {
            for block in 0..own.blocks.len() {
                if open[component] && self.coordinate_of(component, block, X_E).is_some() {
                    blocks.extend([(component, block); BLOCK_RESTARTS.len()]);
                }
            }
        }
        let subproblems = BlockSubproblems::new(observations, self, &present, &blocks);
        let start = self.restart_coordinates(observations, &subproblems, &blocks);
        let equations = subproblems.normal_equations(&start);
        let kept: Vec<usize> = (0..blocks.len())
            .filter(|subproblem| {
                let block = &blocks[*subproblem];
                let own = &self.parameterisation.components[block.0].blocks[block.1];
                let x_e = self.coordinate_of(block.0, block.1, X_E);
                let held: Vec<bool> = own.iter().map(|index| Some(*index) == x_e).collect();
                let predicted = equations[*subproblem].predicted_block_cost(0, &held);
                let present = &present[block.0];
                predicted
                    < present_cost(present, *block)
                        + MAX_EXCESS * self.cost_unit(observations, *block, present)
            })
            .collect();
        self.optima_from(observations, &present, (&subproblems, &blocks), &kept, &start)
    }

    /// The optima that the subproblems `kept` reach from the coordinates `start`; each is one of the block of the same index.
    pub(super) fn optima_from(
        &self,
        observations: &Observations,
        present: &[GaussNewtonEquations],
        (subproblems, blocks): (&BlockSubproblems, &[BlockIndex]),
        kept: &[usize],
        start: &[f64],
    ) -> Vec<AlternativeOptimum> {
        let solution = subproblems.solve(&subproblems.subset(kept), start, self.restart_options());
        let alternative = |(subproblem, outcome): (&usize, &ComponentOutcome)| {
            let (block, range) = (blocks[*subproblem], subproblems.ranges[*subproblem].clone());
            let own = &self.parameterisation.components[block.0].blocks[block.1];
            let coordinates = solution.coordinates[range][..own.len()].to_vec();
            let x_e = self.coordinate_of(block.0, block.1, X_E);
            let position = own.iter().position(|index| Some(*index) == x_e).unwrap_or(0);
            let distance = (coordinates[position] - self.solution.coordinates[own[position]]).abs();
            let present = &present[block.0];
            let decrease =
                (present_cost(present, block) - outcome.cost) / self.cost_unit(observations, block, present);
            AlternativeOptimum { block, decrease, log_x_e: coordinates[position], distance, coordinates }
        };
        kept.iter().zip(&solution.outcomes).map(alternative).collect()
    }

    /// Coordinates from which the subproblems start: the optimum of the fit, except for k_srs, k_dec and x_e of the block.
    fn restart_coordinates(
        &self,
        observations: &Observations,
        subproblems: &BlockSubproblems,
        blocks: &[BlockIndex],
    ) -> Vec<f64> {
        let mut start = subproblems.start.clone();
        for (subproblem, block) in blocks.iter().enumerate() {
            let component = &self.parameterisation.components[block.0];
            let Some(trial) = component.trials_of_block(block.1).next() else { continue };
            let restart = BLOCK_RESTARTS[subproblem % BLOCK_RESTARTS.len()];
            for (parameter, value) in self.restart_values(observations, trial, restart) {
                let Some(coordinate) = self.coordinate_of(block.0, block.1, parameter) else { continue };
                let own = &component.blocks[block.1];
                let at = subproblems.ranges[subproblem].start
                    + own.iter().position(|index| *index == coordinate).unwrap_or(0);
                let bounds = &subproblems.parameterisation.coordinates[at];
                start[at] = libm::log(value).clamp(bounds.low, bounds.high);
            }
        }
        start
    }

    /// k_srs, k_dec and x_e of a trial at a restart, by parameter index. The mean stiffness up to the end of the window stays, because
    /// the data determine it.
    pub(in crate::fit) fn restart_values(
        &self,
        observations: &Observations,
        trial: usize,
        (x_e_fraction, k_dec_fraction): Restart,
    ) -> [(usize, f64); 3] {
        let (own, peak_angle) = (&self.parameters[trial], observations.peak_angle_rad(trial));
        let mean = own[K_SRS] - own[K_DEC] * (1.0 - own[X_E] / peak_angle).max(0.0);
        let k_srs = mean.max(0.2 * own[K_SRS]) / (1.0 - k_dec_fraction * (1.0 - x_e_fraction));
        [(K_SRS, k_srs), (K_DEC, k_dec_fraction * k_srs), (X_E, x_e_fraction * peak_angle)]
    }

    /// Records in `found`, for each open component, the other optima that the noise does not rule out, each once.
    fn collect_other_optima(
        &self,
        alternatives: &[AlternativeOptimum],
        open: &[bool],
        found: &mut [Vec<BlockOptimum>],
    ) {
        (0..open.len()).filter(|component| open[*component]).for_each(|component| found[component].clear());
        let best = |block: BlockIndex| {
            let own = alternatives.iter().filter(|alternative| alternative.block == block);
            own.map(|alternative| alternative.decrease).fold(0.0, f64::max)
        };
        let mut order: Vec<&AlternativeOptimum> = alternatives
            .iter()
            .filter(|own| {
                own.distance > DISTINCT_OPTIMUM_LOG_X_E && best(own.block) - own.decrease < MAX_EXCESS
            })
            .collect();
        order.sort_by(|a, b| b.decrease.total_cmp(&a.decrease));
        let mut kept: Vec<&AlternativeOptimum> = Vec::new();
        for own in order {
            let is_known = |other: &&&AlternativeOptimum| {
                other.block == own.block && (other.log_x_e - own.log_x_e).abs() < DISTINCT_OPTIMUM_LOG_X_E
            };
            if kept.iter().find(is_known).is_none() {
                kept.push(own);
            }
        }
        for own in kept {
            let (component, block) = own.block;
            found[component].push(BlockOptimum {
                trials: self.parameterisation.components[component].trials_of_block(block).collect(),
                coordinates: own.coordinates.clone(),
                excess: best(own.block) - own.decrease,
            });
        }
    }

    /// Continues from the best alternative of each block that improves; returns for each component whether a block improved.
    pub(super) fn adopt_best_blocks(
        &mut self,
        observations: &Observations,
        alternatives: &[AlternativeOptimum],
        options: SolverOptions,
    ) -> Vec<bool> {
        let mut merged = self.solution.coordinates.clone();
        let mut improved = vec![false; self.parameterisation.components.len()];
        let mut better: Vec<&AlternativeOptimum> =
            alternatives.iter().filter(|alternative| alternative.decrease > MIN_BLOCK_DECREASE).collect();
        // The best alternative of a block comes last and overwrites the others.
        better.sort_by(|a, b| a.decrease.total_cmp(&b.decrease));
        for alternative in better {
            let (component, block) = alternative.block;
            improved[component] = true;
            let coordinates = &self.parameterisation.components[component].blocks[block];
            for (index, value) in coordinates.iter().zip(&alternative.coordinates) {
                merged[*index] = *value;
            }
        }
        self.adopt_if_better(observations, &improved, &merged, options);
        improved
    }

    /// Optimises the components that `improved` from the coordinates `merged`, and adopts those whose cost is lower than before.
    fn adopt_if_better(
        &mut self,
        observations: &Observations,
        improved: &[bool],
        merged: &[f64],
        options: SolverOptions,
    ) {
        if !improved.contains(&true) {
            return;
        }
        let components = self.parameterisation.components.iter().enumerate();
        let some = Parameterisation {
            components: components
                .filter(|(index, _)| improved[*index])
                .map(|(_, own)| own.clone())
                .collect(),
            ..self.parameterisation.clone()
        };
        let found: Solution = solve(observations, &some, &self.kinds, &self.objective, merged, options);
        let optimised = (0..improved.len()).filter(|component| improved[*component]);
        for (component, outcome) in optimised.zip(found.outcomes) {
            if outcome.cost < self.solution.outcomes[component].cost {
                for coordinate in self.parameterisation.components[component].order() {
                    self.solution.coordinates[coordinate] = found.coordinates[coordinate];
                }
                self.solution.outcomes[component] = outcome;
            }
        }
    }

    /// Normal equations of all components at the optimum.
    pub(super) fn normal_equations(&self, observations: &Observations) -> Vec<GaussNewtonEquations> {
        let components: Vec<_> = self.parameterisation.components.iter().collect();
        let at = &self.solution.coordinates;
        evaluate(observations, &self.parameterisation, &self.kinds, &self.objective, &components, at)
    }

    /// Whether each trial or condition has its own x_e, so that x_e can have several optima per block.
    pub(super) fn has_local_x_e(&self) -> bool {
        let spec = &self.model.base[X_E];
        matches!(spec.scope, Scope::Trial | Scope::Condition) && spec.law.is_empty()
    }

    fn restart_options(&self) -> SolverOptions {
        match self.objective {
            Objective::Whitened(_) => RESTART,
            Objective::LeastSquares => UNWEIGHTED_RESTART,
        }
    }

    /// Index of the coordinate of a block that is the logarithm of a base parameter; `None` if the block has no such coordinate.
    pub(super) fn coordinate_of(&self, component: usize, block: usize, parameter: usize) -> Option<usize> {
        let coordinates = &self.parameterisation.components[component].blocks[block];
        let is_wanted = |index: &usize| {
            let own = &self.parameterisation.coordinates[*index];
            own.parameter == parameter && own.logarithmic
        };
        coordinates.iter().copied().find(is_wanted)
    }

    /// Cost per unit of noise variance in a block: 1 for whitened residuals, otherwise estimated from the residuals of the block, whose
    /// normal equations are among `present`.
    pub(super) fn cost_unit(
        &self,
        observations: &Observations,
        (component, block): BlockIndex,
        present: &GaussNewtonEquations,
    ) -> f64 {
        match self.objective {
            Objective::Whitened(_) => 1.0,
            Objective::LeastSquares => {
                let windows = observations.rows() as f64 * observations.period_s / REFLEX_FREE_S;
                let trials =
                    self.parameterisation.components[component].trials_of_block(block).count() as f64;
                present.block_costs().nth(block).unwrap_or(0.0)
                    / (trials * 0.5 * INDEPENDENT_VALUES * windows)
            }
        }
    }
}

/// The present cost of a block, whose component has these normal equations.
pub(super) fn present_cost(present: &GaussNewtonEquations, (_, block): BlockIndex) -> f64 {
    present.block_costs().nth(block).unwrap_or(f64::INFINITY)
}
