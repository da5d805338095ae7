//! Blocks as problems of their own: a block's trials and the border, with what the other blocks know of the border as the
//! quadratic that is left when they follow. One block may come ambiguous_trials times; all descend side by side.

use std::ops::Range;

use super::fit::Fit;
use crate::fit::data::preprocessing::Observations;
use crate::fit::parameters::parameterisation::{BorderPrior, Component, Parameterisation, Transform};
use crate::fit::solver::levenberg_marquardt::{Solution, SolverOptions, solve};
use crate::fit::solver::normal_equations::{NormalEquations, Objective, evaluate};
use crate::wrist::mechanisms::MechanismKind;

/// A block of trials: index of its component, and of the block in it.
pub(in crate::fit) type BlockIndex = (usize, usize);

/// Small problems, one a place.
pub(in crate::fit) struct BlockSubproblems<'a> {
    kinds: &'a [MechanismKind],
    objective: &'a Objective,
    observations: Observations,
    /// The coordinates of all of them; a component each.
    pub parameterisation: Parameterisation,
    /// Where the fit ended, in these coordinates.
    pub start: Vec<f64>,
    /// The coordinates of each: its block's, then the border's.
    pub ranges: Vec<Range<usize>>,
}

impl<'a> BlockSubproblems<'a> {
    /// The problems of the blocks at `places`, which come one block after the other, about the optimum of `fit`; `normals` are
    /// the normal equations there.
    pub fn new(
        observations: &Observations,
        fit: &'a Fit,
        normals: &[NormalEquations],
        places: &[BlockIndex],
    ) -> Self {
        let at = &fit.solution.coordinates;
        let mut trials = Vec::new();
        let mut known: Option<(BlockIndex, BorderPrior)> = None;
        let mut parameterisation = Parameterisation {
            coordinates: Vec::new(),
            transforms: Vec::new(),
            components: Vec::new(),
            estimated: fit.parameterisation.estimated.clone(),
        };
        let (mut start, mut ranges) = (Vec::new(), Vec::new());
        for (component, block) in places {
            let own = &fit.parameterisation.components[*component];
            let order: Vec<usize> = own.blocks[*block].iter().chain(&own.border).copied().collect();
            let (first, border) = (start.len(), start.len() + own.blocks[*block].len());
            let here = |index: usize| first + order.iter().position(|own| *own == index).unwrap_or(0);
            parameterisation
                .coordinates
                .extend(order.iter().map(|index| fit.parameterisation.coordinates[*index].clone()));
            // What is known of the border beforehand is in what the others know of it.
            parameterisation.coordinates[border..].iter_mut().for_each(|coordinate| coordinate.prior = None);
            start.extend(order.iter().map(|index| at[*index]));
            let first_trial = trials.len();
            trials.extend(own.trials_of_block(*block));
            let links = trials[first_trial..].iter().map(|trial| &fit.parameterisation.transforms[*trial]);
            parameterisation
                .transforms
                .extend(links.map(|own| own.iter().map(|link| moved(link, &here)).collect::<Vec<_>>()));
            if known.as_ref().is_none_or(|(of, _)| *of != (*component, *block)) {
                known = Some((
                    (*component, *block),
                    normals[*component].border_prior_from_others(own, *block, at),
                ));
            }
            parameterisation.components.push(Component {
                trials: (first_trial..trials.len()).collect(),
                blocks: vec![(first..border).collect()],
                block_of_trial: vec![0; trials.len() - first_trial],
                border: (border..start.len()).collect(),
                border_prior: known.as_ref().map(|(_, known)| known.clone()),
            });
            ranges.push(first..start.len());
        }
        let (kinds, objective) = (&fit.kinds, &fit.objective);
        Self { kinds, objective, observations: observations.subset(&trials), parameterisation, start, ranges }
    }

    /// The normal equations of all problems.
    pub fn normals(&self, at: &[f64]) -> Vec<NormalEquations> {
        let components: Vec<&Component> = self.parameterisation.components.iter().collect();
        evaluate(&self.observations, &self.parameterisation, self.kinds, self.objective, &components, at)
    }

    /// Solves the problems that `parameterisation` has; its coordinates are those of all.
    pub fn solve(
        &self,
        parameterisation: &Parameterisation,
        start: &[f64],
        options: SolverOptions,
    ) -> Solution {
        solve(&self.observations, parameterisation, self.kinds, self.objective, start, options)
    }

    /// A parameterisation of some of the problems.
    pub fn subset(&self, problems: &[usize]) -> Parameterisation {
        Parameterisation {
            components: problems
                .iter()
                .map(|index| self.parameterisation.components[*index].clone())
                .collect(),
            ..self.parameterisation.clone()
        }
    }
}

/// A link with its coordinates in other places.
fn moved(link: &Transform, here: &dyn Fn(usize) -> usize) -> Transform {
    match link {
        Transform::Fixed(value) => Transform::Fixed(*value),
        Transform::Logarithmic { coordinate, factor } => {
            Transform::Logarithmic { coordinate: here(*coordinate), factor: *factor }
        }
        Transform::Sum(terms) => {
            Transform::Sum(terms.iter().map(|(index, factor)| (here(*index), *factor)).collect())
        }
    }
}
