//! The parameterisation of a fit: its coordinates, and the transformations from them to the parameters of each trial.

use super::component::Component;
use super::coordinate::{Coordinate, Transform};
use super::partition::partition;
use super::starting_values::StartingValues;
use crate::fit::data::observations::Observations;
use crate::fit::model::parameter_index::{K_DEC, X_E};
use crate::fit::model::specification::{Model, ParameterSpec, Scope};

/// Standard deviations of the prior that shrinks the parameters of single trials towards those of all trials: the parameter, and
/// the standard deviation of its logarithm.
pub(in crate::fit) const SHRINKAGE_SDS: [(usize, f64); 2] = [(K_DEC, 0.4), (X_E, 0.2)];

/// Coordinates of a fit, their transformations to parameters, and their partition into components.
#[derive(Debug, Clone)]
pub struct Parameterisation {
    /// All coordinates.
    pub coordinates: Vec<Coordinate>,
    /// For each trial, the transformations from the coordinates to its parameters.
    pub transforms: Vec<Vec<Transform>>,
    /// The components of the problem.
    pub components: Vec<Component>,
    /// Indices of the parameters that are estimated, in the parameter vector of a trial.
    pub estimated: Vec<usize>,
}

impl Parameterisation {
    /// Coordinates of `model` for `observations`; bounds and starting values come from `starting_values` unless the model gives them.
    pub fn new(observations: &Observations, model: &Model, starting_values: &StartingValues) -> Self {
        let mut parameterisation = Self {
            coordinates: Vec::new(),
            transforms: vec![Vec::new(); observations.trials.len()],
            components: Vec::new(),
            estimated: Vec::new(),
        };
        let mut block_scope = Scope::Session;
        let mut affected: Vec<Vec<usize>> = Vec::new();
        let mut is_own = Vec::new();
        for (parameter, spec) in model.parameter_specs().into_iter().enumerate() {
            if spec.scope == Scope::Fixed {
                let value = spec.value.unwrap_or(0.0);
                let transforms = parameterisation.transforms.iter_mut();
                transforms.for_each(|transforms| transforms.push(Transform::Fixed(value)));
                continue;
            }
            parameterisation.estimated.push(parameter);
            if spec.law.is_empty() && matches!(spec.scope, Scope::Trial | Scope::Condition) {
                // A block covers a condition as soon as one parameter is shared by a condition's repetitions.
                block_scope = if spec.scope == Scope::Condition || block_scope == Scope::Condition {
                    Scope::Condition
                } else {
                    Scope::Trial
                };
            }
            for members in trial_groups(observations, spec.scope) {
                let bounds = starting_values.bounds(model, parameter, spec, &members);
                if spec.law.is_empty() {
                    let (coordinate, transform) = Coordinate::of(parameter, bounds);
                    parameterisation.add_coordinate(coordinate, transform, &members);
                    affected.push(members);
                    is_own.push(matches!(spec.scope, Scope::Trial | Scope::Condition));
                } else {
                    parameterisation.add_law(observations, (parameter, spec), bounds.start, &members);
                    affected.extend(std::iter::repeat_n(members, spec.law.len()));
                    is_own.extend(std::iter::repeat_n(false, spec.law.len()));
                }
            }
        }
        parameterisation.components = partition(observations, block_scope, &affected, &is_own);
        parameterisation
    }

    /// Adds the coordinate of a parameter that the trials `members` share.
    fn add_coordinate(
        &mut self,
        coordinate: Coordinate,
        transform: fn(usize) -> Transform,
        members: &[usize],
    ) {
        let index = self.coordinates.len();
        self.coordinates.push(coordinate);
        members.iter().for_each(|trial| self.transforms[*trial].push(transform(index)));
    }

    /// Adds the coefficients of the law of a parameter for the trials `members`. Each term starts with an equal share of `start`, on
    /// average over the trials.
    fn add_law(
        &mut self,
        observations: &Observations,
        (parameter, spec): (usize, &ParameterSpec),
        start: f64,
        members: &[usize],
    ) {
        let first = self.coordinates.len();
        for term in &spec.law {
            let mean_factor = members
                .iter()
                .map(|t| {
                    term.factor(observations.trials[*t].velocity_rad_s, observations.trials[*t].torque_nm)
                })
                .sum::<f64>()
                / members.len() as f64;
            let share = start / (spec.law.len() as f64 * mean_factor.max(1e-12));
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
        }
        for trial in members {
            let own = &observations.trials[*trial];
            let terms = spec.law.iter().enumerate();
            self.transforms[*trial].push(Transform::Sum(
                terms.map(|(i, term)| (first + i, term.factor(own.velocity_rad_s, own.torque_nm))).collect(),
            ));
        }
    }

    /// Gives k_dec and x_e of single trials a prior about the values of `target`.
    pub(in crate::fit) fn shrink_towards(&mut self, target: &StartingValues) {
        for (trial, transforms) in self.transforms.iter().enumerate() {
            for (parameter, sd) in SHRINKAGE_SDS {
                if let Transform::Logarithmic { coordinate, factor } = transforms[parameter] {
                    let mean = libm::log(target.value(trial, parameter) / factor);
                    self.coordinates[coordinate].prior = Some((mean, sd));
                }
            }
        }
    }

    /// Starting values of all coordinates, within the bounds.
    pub fn start(&self) -> Vec<f64> {
        self.coordinates.iter().map(|c| c.start.clamp(c.low, c.high)).collect()
    }

    /// Appends the parameters of a trial at `coordinates` to `into`.
    pub fn parameters(&self, trial: usize, coordinates: &[f64], into: &mut Vec<f64>) {
        for transform in &self.transforms[trial] {
            into.push(match transform {
                Transform::Fixed(value) => *value,
                Transform::Logarithmic { coordinate, factor } => factor * libm::exp(coordinates[*coordinate]),
                Transform::Sum(terms) => {
                    terms.iter().map(|(index, factor)| factor * coordinates[*index]).sum()
                }
            });
        }
    }

    /// The coordinate that is the logarithm of a parameter of a trial; `None` if the parameter is not estimated on such a scale.
    pub fn logarithmic_coordinate(&self, trial: usize, parameter: usize) -> Option<usize> {
        match self.transforms[trial][parameter] {
            Transform::Logarithmic { coordinate, .. } => Some(coordinate),
            _ => None,
        }
    }

    /// Calls `each` with every coordinate that a parameter of a trial depends on, and the derivative of the parameter with respect to
    /// that coordinate. `value` is the value of the parameter.
    pub fn slopes(&self, trial: usize, parameter: usize, value: f64, mut each: impl FnMut(usize, f64)) {
        match &self.transforms[trial][parameter] {
            Transform::Fixed(_) => {}
            Transform::Logarithmic { coordinate, .. } => each(*coordinate, value),
            Transform::Sum(terms) => terms.iter().for_each(|(index, factor)| each(*index, *factor)),
        }
    }
}

/// Groups of trials that share the value of a parameter with this scope.
pub(in crate::fit) fn trial_groups(observations: &Observations, scope: Scope) -> Vec<Vec<usize>> {
    let key = |trial: usize| match scope {
        Scope::Trial => trial,
        Scope::Condition => observations.trials[trial].condition,
        Scope::Repetition => observations.trials[trial].repetition as usize,
        Scope::Session | Scope::Fixed => 0,
    };
    let count = observations.trials.len();
    let mut keys: Vec<usize> = (0..count).map(key).collect();
    keys.sort_unstable();
    keys.dedup();
    keys.iter().map(|own| (0..count).filter(|trial| key(*trial) == *own).collect()).collect()
}
