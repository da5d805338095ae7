//! Block subproblems: the trials of one block as a problem of their own, with the border and a quadratic approximation of what the
//! other blocks know about it. A block may occur several times, with different starts; all subproblems are solved side by side.

use std::ops::Range;

use nalgebra::DMatrix;

use super::fit::Fit;
use crate::fit::data::observations::Observations;
use crate::fit::parameters::component::{BorderPrior, Component};
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::levenberg_marquardt::{Solution, solve};
use crate::fit::solver::normal_equations::{GaussNewtonEquations, evaluate, whitened_derivatives};
use crate::fit::solver::options::SolverOptions;
use crate::wrist::mechanisms::MechanismKind;

/// A block of a session: index of its component, and index of the block in the component.
pub type BlockIndex = (usize, usize);

/// Subproblems of some blocks about the optimum of a fit.
pub struct BlockSubproblems<'a> {
    kinds: &'a [MechanismKind],
    objective: &'a Objective,
    observations: Observations,
    /// Coordinates of all subproblems; each subproblem is a component.
    pub parameterisation: Parameterisation,
    /// The optimum of the fit, in these coordinates.
    pub start: Vec<f64>,
    /// For each subproblem, the range of its coordinates: those of the block, then those of the border.
    pub ranges: Vec<Range<usize>>,
}

impl<'a> BlockSubproblems<'a> {
    /// Subproblems of `blocks`, each of which may occur several times. `equations` are the normal equations of the components at the
    /// optimum of `fit`.
    pub fn new(
        observations: &Observations,
        fit: &'a Fit,
        equations: &[GaussNewtonEquations],
        blocks: &[BlockIndex],
    ) -> Self {
        let at = &fit.solution.coordinates;
        let mut trials = Vec::new();
        let mut priors: Vec<Option<Vec<BorderPrior>>> = vec![None; equations.len()];
        let mut parameterisation = Parameterisation {
            coordinates: Vec::new(),
            transforms: Vec::new(),
            components: Vec::new(),
            estimated: fit.parameterisation.estimated.clone(),
        };
        let (mut start, mut ranges) = (Vec::new(), Vec::new());
        for (component, block) in blocks {
            let own = &fit.parameterisation.components[*component];
            let order: Vec<usize> = own.blocks[*block].iter().chain(&own.border).copied().collect();
            let (first, border) = (start.len(), start.len() + own.blocks[*block].len());
            let index_here = |index: usize| {
                let position = order.iter().position(|own| *own == index);
                first + position.expect("a coordinate of the block or of the border")
            };
            let coordinates = order.iter().map(|index| fit.parameterisation.coordinates[*index].clone());
            parameterisation.coordinates.extend(coordinates);
            // The border prior contains the priors of the border's coordinates.
            parameterisation.coordinates[border..].iter_mut().for_each(|coordinate| coordinate.prior = None);
            start.extend(order.iter().map(|index| at[*index]));
            let first_trial = trials.len();
            trials.extend(own.trials_of_block(*block));
            for trial in &trials[first_trial..] {
                let transforms = fit.parameterisation.transforms[*trial].iter();
                let here = transforms.map(|transform| transform.reindexed(index_here)).collect();
                parameterisation.transforms.push(here);
            }
            let of_component = priors[*component]
                .get_or_insert_with(|| equations[*component].border_priors_from_others(own, at));
            parameterisation.components.push(Component {
                trials: (first_trial..trials.len()).collect(),
                blocks: vec![(first..border).collect()],
                block_of_trial: vec![0; trials.len() - first_trial],
                border: (border..start.len()).collect(),
                border_prior: Some(of_component[*block].clone()),
            });
            ranges.push(first..start.len());
        }
        Self {
            kinds: &fit.kinds,
            objective: &fit.objective,
            observations: observations.subset(&trials),
            parameterisation,
            start,
            ranges,
        }
    }

    /// Normal equations of all subproblems at `coordinates`.
    pub fn normal_equations(&self, coordinates: &[f64]) -> Vec<GaussNewtonEquations> {
        let components: Vec<&Component> = self.parameterisation.components.iter().collect();
        evaluate(
            &self.observations,
            &self.parameterisation,
            self.kinds,
            self.objective,
            &components,
            coordinates,
        )
    }

    /// Whitened derivatives and residuals of all subproblems at `coordinates`; see [`whitened_derivatives`].
    pub fn whitened_derivatives(&self, coordinates: &[f64]) -> Vec<DMatrix<f64>> {
        let components: Vec<&Component> = self.parameterisation.components.iter().collect();
        whitened_derivatives(
            &self.observations,
            &self.parameterisation,
            self.kinds,
            self.objective,
            &components,
            coordinates,
        )
    }

    /// Solves the subproblems that are components of `parameterisation`; see [`BlockSubproblems::subset`].
    pub fn solve(
        &self,
        parameterisation: &Parameterisation,
        start: &[f64],
        options: SolverOptions,
    ) -> Solution {
        solve(&self.observations, parameterisation, self.kinds, self.objective, start, options)
    }

    /// A parameterisation with the components of `subproblems`, given by index, and the coordinates of all.
    pub fn subset(&self, subproblems: &[usize]) -> Parameterisation {
        Parameterisation {
            components: subproblems
                .iter()
                .map(|index| self.parameterisation.components[*index].clone())
                .collect(),
            ..self.parameterisation.clone()
        }
    }
}
