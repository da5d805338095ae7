//! From the fit model to the coordinates that the least squares moves, and back to each trial's parameters.
//!
//! Trials that share no coordinate are separate problems (the paper's repetitions); within one, coordinates of a single
//! trial or condition are its block, and the others its border: the arrowhead that the solver exploits.

use nalgebra::{DMatrix, DVector};

use crate::fit::data::preprocessing::Observations;
use crate::fit::model::specification::{LawTerm, Model, ParameterSpec, Scope};
use crate::fit::search::starting_values::{BoundedStart, StartingValues};
use crate::wrist::BASE_PARAMETERS;

/// One number that the least squares moves.
#[derive(Debug, Clone, PartialEq)]
pub struct Coordinate {
    /// Which parameter of the trial's vector it belongs to.
    pub parameter: usize,
    /// The term of the law that it is the coefficient of.
    pub term: Option<LawTerm>,
    /// It is the parameter's logarithm.
    pub logarithmic: bool,
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// Where the fit starts.
    pub start: f64,
    /// Size of a notable change.
    pub scale: f64,
    /// What is known of it beforehand: a centre and a standard deviation.
    pub prior: Option<(f64, f64)>,
}

impl Coordinate {
    /// The coordinate of a parameter that may go over `range`, and how the parameter comes from it: by its logarithm where it
    /// cannot but be positive.
    pub(in crate::fit) fn of(parameter: usize, range: BoundedStart) -> (Self, fn(usize) -> Transform) {
        let logarithmic = range.low > 0.0;
        let place = |x: f64| if logarithmic { libm::log(x) } else { x };
        let scale = range.start.abs().max(1e-6 * (range.high - range.low).min(1e3)).max(1e-12);
        let coordinate = Self {
            parameter,
            term: None,
            logarithmic,
            low: place(range.low),
            high: place(range.high),
            start: place(range.start),
            scale: if logarithmic { 1.0 } else { scale },
            prior: None,
        };
        let by_logarithm: fn(usize) -> Transform =
            |coordinate| Transform::Logarithmic { coordinate, factor: 1.0 };
        let as_it_is: fn(usize) -> Transform = |coordinate| Transform::Sum(vec![(coordinate, 1.0)]);
        (coordinate, if logarithmic { by_logarithm } else { as_it_is })
    }
}

/// How a trial's parameter comes from the coordinates.
#[derive(Debug, Clone, PartialEq)]
pub enum Transform {
    /// It does not.
    Fixed(f64),
    /// It is e to the power of a coordinate, times a factor.
    Logarithmic {
        /// Which coordinate.
        coordinate: usize,
        /// The factor.
        factor: f64,
    },
    /// It is a sum of coordinates times factors.
    Sum(Vec<(usize, f64)>),
}

/// Trials that share coordinates, and no coordinate with any other trial.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Component {
    /// Its trials.
    pub trials: Vec<usize>,
    /// Its blocks: coordinates that only touch some of the trials.
    pub blocks: Vec<Vec<usize>>,
    /// The block of each of its trials.
    pub block_of_trial: Vec<usize>,
    /// Coordinates in common.
    pub border: Vec<usize>,
    /// What trials that are not in it know of the border.
    pub border_prior: Option<BorderPrior>,
}

/// A quadratic in the border's coordinates: gradient and curvature at a point.
#[derive(Debug, Clone, PartialEq)]
pub struct BorderPrior {
    /// The point.
    pub at: DVector<f64>,
    /// The gradient there.
    pub gradient: DVector<f64>,
    /// The curvature.
    pub information: DMatrix<f64>,
}

impl Component {
    /// The trials of one block.
    pub fn trials_of_block(&self, block: usize) -> impl Iterator<Item = usize> {
        let with_block = self.trials.iter().zip(&self.block_of_trial);
        with_block.filter(move |(_, of)| **of == block).map(|(trial, _)| *trial)
    }
}

/// The coordinates of a fit.
#[derive(Debug, Clone)]
pub struct Parameterisation {
    /// All coordinates.
    pub coordinates: Vec<Coordinate>,
    /// For each trial, how each of its parameters comes from them.
    pub transforms: Vec<Vec<Transform>>,
    /// The separate problems.
    pub components: Vec<Component>,
    /// Which parameters are estimated in any trial.
    pub estimated: Vec<usize>,
}

impl Parameterisation {
    /// The coordinates of `model` for `observations`, starting at `starting_values`.
    pub fn new(observations: &Observations, model: &Model, starting_values: &StartingValues) -> Self {
        let count = observations.trials.len();
        let mut parameterisation = Self {
            coordinates: Vec::new(),
            transforms: vec![Vec::new(); count],
            components: Vec::new(),
            estimated: Vec::new(),
        };
        let mut finest = Scope::Session;
        let mut touched: Vec<Vec<usize>> = Vec::new();
        for (parameter, treatment) in model.treatments().into_iter().enumerate() {
            if treatment.scope == Scope::Fixed {
                let value = treatment.value.unwrap_or(0.0);
                parameterisation.transforms.iter_mut().for_each(|links| links.push(Transform::Fixed(value)));
                continue;
            }
            parameterisation.estimated.push(parameter);
            if treatment.law.is_empty() && matches!(treatment.scope, Scope::Trial | Scope::Condition) {
                // Blocks are as coarse as the coarsest local parameter.
                finest = if treatment.scope == Scope::Condition || finest == Scope::Condition {
                    Scope::Condition
                } else {
                    Scope::Trial
                };
            }
            for members in groups(observations, treatment.scope) {
                parameterisation.add(
                    observations,
                    model,
                    starting_values,
                    (parameter, treatment),
                    &members,
                    &mut touched,
                );
            }
        }
        parameterisation.split(observations, finest, &touched);
        parameterisation
    }

    /// Adds the coordinates of one parameter for the trials that share it.
    fn add(
        &mut self,
        observations: &Observations,
        model: &Model,
        starting_values: &StartingValues,
        (parameter, treatment): (usize, &ParameterSpec),
        members: &[usize],
        touched: &mut Vec<Vec<usize>>,
    ) {
        let range = starting_values.range(model, parameter, treatment, members);
        if treatment.law.is_empty() {
            let (coordinate, link) = Coordinate::of(parameter, range);
            self.coordinates.push(coordinate);
            touched.push(members.to_vec());
            let index = self.coordinates.len() - 1;
            members.iter().for_each(|trial| self.transforms[*trial].push(link(index)));
            return;
        }
        // A law starts as the constant nearest to the starting_values: its other terms are for the fit to find.
        let first = self.coordinates.len();
        for term in &treatment.law {
            let mean_factor = members
                .iter()
                .map(|t| {
                    term.factor(observations.trials[*t].velocity_rad_s, observations.trials[*t].torque_nm)
                })
                .sum::<f64>()
                / members.len() as f64;
            let share = range.start / (treatment.law.len() as f64 * mean_factor.max(1e-12));
            self.coordinates.push(Coordinate {
                parameter,
                term: Some(*term),
                logarithmic: false,
                low: f64::NEG_INFINITY,
                high: f64::INFINITY,
                start: share,
                scale: share.abs().max(1e-12),
                prior: None,
            });
            touched.push(members.to_vec());
        }
        for trial in members {
            let own = &observations.trials[*trial];
            let sum = treatment.law.iter().enumerate();
            self.transforms[*trial].push(Transform::Sum(
                sum.map(|(i, term)| (first + i, term.factor(own.velocity_rad_s, own.torque_nm))).collect(),
            ));
        }
    }

    /// Separates the problems, and in each the blocks from the border.
    fn split(&mut self, observations: &Observations, finest: Scope, touched: &[Vec<usize>]) {
        let count = observations.trials.len();
        let block_key: Vec<usize> = (0..count)
            .map(|trial| match finest {
                Scope::Condition => observations.trials[trial].condition,
                _ => trial,
            })
            .collect();
        // Union of the trials that share a coordinate or a block.
        let mut root: Vec<usize> = (0..count).collect();
        fn find(root: &mut [usize], mut trial: usize) -> usize {
            while root[trial] != trial {
                root[trial] = root[root[trial]];
                trial = root[trial];
            }
            trial
        }
        let mut join = |a: usize, b: usize| {
            let (a, b) = (find(&mut root, a), find(&mut root, b));
            root[a.max(b)] = a.min(b);
        };
        for members in touched {
            members.iter().for_each(|trial| join(members[0], *trial));
        }
        for trial in 0..count {
            if let Some(other) = (0..trial).find(|other| block_key[*other] == block_key[trial]) {
                join(other, trial);
            }
        }
        let roots: Vec<usize> = (0..count).map(|trial| find(&mut root, trial)).collect();
        let mut heads = roots.clone();
        heads.sort_unstable();
        heads.dedup();
        for head in heads {
            let trials: Vec<usize> = (0..count).filter(|trial| roots[*trial] == head).collect();
            let mut keys: Vec<usize> = trials.iter().map(|trial| block_key[*trial]).collect();
            keys.sort_unstable();
            keys.dedup();
            let block = |trial: usize| keys.binary_search(&block_key[trial]).unwrap_or(0);
            let mut component = Component {
                block_of_trial: trials.iter().map(|trial| block(*trial)).collect(),
                blocks: vec![Vec::new(); keys.len()],
                border: Vec::new(),
                border_prior: None,
                trials,
            };
            for (coordinate, members) in touched.iter().enumerate() {
                if roots[members[0]] != head {
                    continue;
                }
                let own = block(members[0]);
                if finest != Scope::Session && members.iter().all(|trial| block(*trial) == own) {
                    component.blocks[own].push(coordinate);
                } else {
                    component.border.push(coordinate);
                }
            }
            self.components.push(component);
        }
    }

    /// Makes single trials shrinkage_target on `starting_values` where their own data hardly tell: for each parameter given, the logarithm's
    /// standard deviation.
    pub fn shrinkage_target(&mut self, starting_values: &StartingValues, parameters: &[(usize, f64)]) {
        for (trial, links) in self.transforms.iter().enumerate() {
            for (parameter, sd) in parameters {
                if let Transform::Logarithmic { coordinate, factor } = links[*parameter] {
                    let centre = libm::log(starting_values.value(trial, *parameter) / factor);
                    self.coordinates[coordinate].prior = Some((centre, *sd));
                }
            }
        }
    }

    /// Where the fit starts.
    pub fn start(&self) -> Vec<f64> {
        self.coordinates.iter().map(|c| c.start.clamp(c.low, c.high)).collect()
    }

    /// A trial's parameters at `coordinates`.
    pub fn parameters(&self, trial: usize, coordinates: &[f64], into: &mut Vec<f64>) {
        for link in &self.transforms[trial] {
            into.push(match link {
                Transform::Fixed(value) => *value,
                Transform::Logarithmic { coordinate, factor } => factor * libm::exp(coordinates[*coordinate]),
                Transform::Sum(terms) => {
                    terms.iter().map(|(index, factor)| factor * coordinates[*index]).sum()
                }
            });
        }
    }

    /// How a trial's parameter number `parameter` changes with the coordinates, at its value `value`.
    pub fn slopes(&self, trial: usize, parameter: usize, value: f64, mut each: impl FnMut(usize, f64)) {
        match &self.transforms[trial][parameter] {
            Transform::Fixed(_) => {}
            Transform::Logarithmic { coordinate, .. } => each(*coordinate, value),
            Transform::Sum(terms) => terms.iter().for_each(|(index, factor)| each(*index, *factor)),
        }
    }

    /// Whether the parameter is one of the six of the base model.
    pub fn is_base(parameter: usize) -> bool {
        parameter < BASE_PARAMETERS.len()
    }
}

/// The trials that share a parameter of this scope, group by group.
pub(in crate::fit) fn groups(observations: &Observations, scope: Scope) -> Vec<Vec<usize>> {
    let key = |trial: usize| match scope {
        Scope::Trial => trial,
        Scope::Condition => observations.trials[trial].condition,
        Scope::Repetition => observations.trials[trial].repetition as usize,
        Scope::Session | Scope::Fixed => 0,
    };
    let mut keys: Vec<usize> = (0..observations.trials.len()).map(key).collect();
    keys.sort_unstable();
    keys.dedup();
    keys.iter()
        .map(|own| (0..observations.trials.len()).filter(|trial| key(*trial) == *own).collect())
        .collect()
}
