//! The result of a fit: the model, its parameterisation and the optimum.

use crate::fit::data::observations::Observations;
use crate::fit::model::specification::{Model, mechanism_ranges};
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::parameters::starting_values::StartingValues;
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::levenberg_marquardt::{ComponentOutcome, Solution, solve};
use crate::fit::solver::options::SolverOptions;
use crate::signal::NoiseCovariance;
use crate::wrist::mechanisms::MechanismKind;

/// A model fitted to the observations of a session.
///
/// `Fit::new` fits a session with all steps of the pipeline. The other constructors and the methods that return a fit are the steps:
/// fits from given starting values (here), fits that start at another optimum (`warm_start`), the multistart search and the shrinkage
/// (`search`).
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// The mechanisms of the model, in order.
    pub kinds: Vec<MechanismKind>,
    /// The parameterisation.
    pub parameterisation: Parameterisation,
    /// The objective that was minimised.
    pub objective: Objective,
    /// Covariances of the residuals, one per noise covariance of the session; empty if no noise could be estimated.
    pub residual_covariances: Vec<NoiseCovariance>,
    /// The optimum.
    pub solution: Solution,
    /// Parameters of each trial at the optimum, in the order of [`Model::parameter_names`].
    pub parameters: Vec<Vec<f64>>,
    /// Values to which the priors shrink k_dec and x_e of single trials; `None` without shrinkage.
    pub shrinkage_target: Option<StartingValues>,
    /// Other optima of single blocks that the search found.
    pub other_optima: Vec<BlockOptimum>,
}

/// Another optimum of a block.
#[derive(Debug, Clone, PartialEq)]
pub struct BlockOptimum {
    /// The trials of the block.
    pub trials: Vec<usize>,
    /// Coordinates of the block there, in the order of the block.
    pub coordinates: Vec<f64>,
    /// By how much its cost exceeds that of the fit, per unit of noise variance.
    pub excess: f64,
}

impl Fit {
    /// Fits `model` from `starting_values`, without the search for other optima.
    pub fn from_starting_values(
        observations: &Observations,
        model: &Model,
        objective: Objective,
        residual_covariances: Vec<NoiseCovariance>,
        starting_values: &StartingValues,
    ) -> Self {
        let parameterisation = Parameterisation::new(observations, model, starting_values);
        let start = parameterisation.start();
        Self::from_start(observations, model, parameterisation, objective, residual_covariances, &start)
    }

    /// Fits `model` with its `parameterisation` from the coordinates `start`, without the search for other optima.
    pub fn from_start(
        observations: &Observations,
        model: &Model,
        parameterisation: Parameterisation,
        objective: Objective,
        residual_covariances: Vec<NoiseCovariance>,
        start: &[f64],
    ) -> Self {
        let kinds = model.kinds();
        let options = SolverOptions::default();
        let solution = solve(observations, &parameterisation, &kinds, &objective, start, options);
        let mut fit = Self {
            model: model.clone(),
            kinds,
            parameterisation,
            objective,
            residual_covariances,
            solution,
            parameters: Vec::new(),
            shrinkage_target: None,
            other_optima: Vec::new(),
        };
        fit.update_parameters();
        fit
    }

    /// This fit with another solution of its parameterisation.
    pub fn at_solution(&self, solution: Solution) -> Self {
        let mut fit = Self { solution, ..self.clone() };
        fit.update_parameters();
        fit
    }

    /// Cost of the whole session: half the sum of squared residuals, priors included.
    pub fn cost(&self) -> f64 {
        self.solution.cost()
    }

    /// Parameters of a mechanism in the first trial; `None` if the model does not have it.
    pub fn parameters_of(&self, kind: MechanismKind) -> Option<&[f64]> {
        let place = self.kinds.iter().position(|own| *own == kind)?;
        Some(&self.parameters[0][mechanism_ranges(&self.kinds)[place].clone()])
    }

    /// Parameters of the last mechanism of the model; empty if the model has no mechanism.
    pub fn last_mechanism_parameters(&self) -> &[f64] {
        match mechanism_ranges(&self.kinds).pop() {
            Some(range) => &self.parameters[0][range],
            None => &[],
        }
    }

    /// Result of the optimisation of the component that a trial belongs to.
    pub fn outcome(&self, trial: usize) -> ComponentOutcome {
        let component =
            self.parameterisation.components.iter().position(|component| component.trials.contains(&trial));
        self.solution.outcomes[component.expect("every trial belongs to a component")]
    }

    /// Indices of the coordinates of the block that a trial belongs to.
    pub(in crate::fit) fn block_coordinates(&self, trial: usize) -> &[usize] {
        for component in &self.parameterisation.components {
            if let Some(place) = component.trials.iter().position(|own| *own == trial) {
                return &component.blocks[component.block_of_trial[place]];
            }
        }
        &[]
    }

    /// The six base parameters of a trial at `coordinates`.
    pub(in crate::fit) fn base_values(&self, trial: usize, coordinates: &[f64]) -> [f64; 6] {
        let mut values = Vec::new();
        self.parameterisation.parameters(trial, coordinates, &mut values);
        std::array::from_fn(|parameter| values[parameter])
    }

    /// Whether a parameter of a trial ended at a bound.
    pub fn at_bound(&self, trial: usize, parameter: usize) -> bool {
        let mut at_bound = false;
        self.parameterisation.slopes(trial, parameter, 1.0, |coordinate, _| {
            at_bound |= self.coordinate_at_bound(coordinate);
        });
        at_bound
    }

    /// Whether a coordinate ended at a bound.
    pub(in crate::fit) fn coordinate_at_bound(&self, coordinate: usize) -> bool {
        let (c, x) = (&self.parameterisation.coordinates[coordinate], self.solution.coordinates[coordinate]);
        x <= c.low + 1e-6 || x >= c.high - 1e-6
    }

    /// Computes the parameters of all trials from the coordinates of the solution.
    pub(in crate::fit) fn update_parameters(&mut self) {
        self.parameters = (0..self.parameterisation.transforms.len())
            .map(|trial| {
                let mut own = Vec::new();
                self.parameterisation.parameters(trial, &self.solution.coordinates, &mut own);
                own
            })
            .collect();
    }
}
