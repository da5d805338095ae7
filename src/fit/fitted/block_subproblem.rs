//! Blocks as problems of their own: a block's trials and the border, with what the other blocks know of the border as the
//! quadratic that is left when they follow. One block may come several times; all descend side by side.

use std::ops::Range;

use super::fit::Fit;
use crate::fit::data::preprocessing::Prepared;
use crate::fit::parameters::parameterisation::{BorderKnown, Component, Layout, Link};
use crate::fit::solver::levenberg_marquardt::{Effort, Solution, solve};
use crate::fit::solver::normal_equations::{Normal, Objective, evaluate};
use crate::wrist::mechanisms::Kind;

/// A block of trials: index of its component, and of the block in it.
pub(in crate::fit) type Place = (usize, usize);

/// Small problems, one a place.
pub(in crate::fit) struct Alone<'a> {
    kinds: &'a [Kind],
    objective: &'a Objective,
    prepared: Prepared,
    /// The coordinates of all of them; a component each.
    pub layout: Layout,
    /// Where the fit ended, in these coordinates.
    pub start: Vec<f64>,
    /// The coordinates of each: its block's, then the border's.
    pub ranges: Vec<Range<usize>>,
}

impl<'a> Alone<'a> {
    /// The problems of the blocks at `places`, which come one block after the other, about the optimum of `fit`; `normals` are
    /// the normal equations there.
    pub fn new(prepared: &Prepared, fit: &'a Fit, normals: &[Normal], places: &[Place]) -> Self {
        let at = &fit.solution.coordinates;
        let mut trials = Vec::new();
        let mut known: Option<(Place, BorderKnown)> = None;
        let mut layout = Layout {
            coordinates: Vec::new(),
            links: Vec::new(),
            components: Vec::new(),
            estimated: fit.layout.estimated.clone(),
        };
        let (mut start, mut ranges) = (Vec::new(), Vec::new());
        for (component, block) in places {
            let own = &fit.layout.components[*component];
            let order: Vec<usize> = own.blocks[*block].iter().chain(&own.border).copied().collect();
            let (first, border) = (start.len(), start.len() + own.blocks[*block].len());
            let here = |index: usize| first + order.iter().position(|own| *own == index).unwrap_or(0);
            layout.coordinates.extend(order.iter().map(|index| fit.layout.coordinates[*index].clone()));
            // What is known of the border beforehand is in what the others know of it.
            layout.coordinates[border..].iter_mut().for_each(|coordinate| coordinate.prior = None);
            start.extend(order.iter().map(|index| at[*index]));
            let first_trial = trials.len();
            trials.extend(own.trials_of_block(*block));
            let links = trials[first_trial..].iter().map(|trial| &fit.layout.links[*trial]);
            layout
                .links
                .extend(links.map(|own| own.iter().map(|link| moved(link, &here)).collect::<Vec<_>>()));
            if known.as_ref().is_none_or(|(of, _)| *of != (*component, *block)) {
                known = Some(((*component, *block), normals[*component].known_by_others(own, *block, at)));
            }
            layout.components.push(Component {
                trials: (first_trial..trials.len()).collect(),
                blocks: vec![(first..border).collect()],
                block_of_trial: vec![0; trials.len() - first_trial],
                border: (border..start.len()).collect(),
                border_known: known.as_ref().map(|(_, known)| known.clone()),
            });
            ranges.push(first..start.len());
        }
        let (kinds, objective) = (&fit.kinds, &fit.objective);
        Self { kinds, objective, prepared: prepared.only(&trials), layout, start, ranges }
    }

    /// The normal equations of all problems.
    pub fn normals(&self, at: &[f64]) -> Vec<Normal> {
        let components: Vec<&Component> = self.layout.components.iter().collect();
        evaluate(&self.prepared, &self.layout, self.kinds, self.objective, &components, at)
    }

    /// Solves the problems that `layout` has; its coordinates are those of all.
    pub fn solve(&self, layout: &Layout, start: &[f64], effort: Effort) -> Solution {
        solve(&self.prepared, layout, self.kinds, self.objective, start, effort)
    }

    /// A layout of some of the problems.
    pub fn only(&self, problems: &[usize]) -> Layout {
        Layout {
            components: problems.iter().map(|index| self.layout.components[*index].clone()).collect(),
            ..self.layout.clone()
        }
    }
}

/// A link with its coordinates in other places.
fn moved(link: &Link, here: &dyn Fn(usize) -> usize) -> Link {
    match link {
        Link::Fixed(value) => Link::Fixed(*value),
        Link::Logarithmic { coordinate, factor } => {
            Link::Logarithmic { coordinate: here(*coordinate), factor: *factor }
        }
        Link::Sum(terms) => Link::Sum(terms.iter().map(|(index, factor)| (here(*index), *factor)).collect()),
    }
}
