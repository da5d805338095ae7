//! A whole fit: weights, start, solution, and a second look at trials that may have ambiguous_trials optima.

use crate::fit::data::hold_noise::NoiseSource;
use crate::fit::data::preprocessing::Observations;
use crate::fit::model::specification::Model;
use crate::fit::parameters::parameterisation::{Parameterisation, Transform};
use crate::fit::residuals::residual_covariance::{covariances, whiteners};
use crate::fit::search::pilot_search::PilotSearch;
use crate::fit::search::shrinkage::LEAN;
use crate::fit::search::starting_values::StartingValues;
use crate::fit::solver::levenberg_marquardt::{ComponentOutcome, Solution, SolverOptions, solve};
use crate::fit::solver::normal_equations::Objective;
use crate::signal::NoiseCovariance;
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::MechanismKind;

/// Which residuals are minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weighting {
    /// Weighed by the noise measured in the holds; plain where there is none.
    #[default]
    MeasuredNoise,
    /// All samples alike, as in the paper (section 2.4).
    Plain,
}

/// A fitted session.
#[derive(Debug, Clone)]
pub struct Fit {
    /// The model.
    pub model: Model,
    /// Its mechanisms.
    pub kinds: Vec<MechanismKind>,
    /// Its coordinates.
    pub parameterisation: Parameterisation,
    /// What was minimised.
    pub objective: Objective,
    /// The covariance of the residuals, one a noise of the session; empty where none could be measured.
    pub residual_covariances: Vec<NoiseCovariance>,
    /// The optimum.
    pub solution: Solution,
    /// Each trial's parameters at the optimum, in the order of [`Model::parameter_names`].
    pub parameters: Vec<Vec<f64>>,
    /// What single trials shrinkage_target on where their own data hardly tell.
    pub shrinkage_target: Option<StartingValues>,
    /// Trials with another optimum that the data do not tell apart from this one.
    pub ambiguous_trials: Vec<usize>,
}

impl Fit {
    /// Fits `model`.
    ///
    /// A plain fit starts where the weighed one ends, if there is a noise to weigh by: the plain sum of squares has many
    /// optima that the noise does not tell apart, and this is the one that the data know.
    pub fn new(observations: &Observations, model: &Model, weighting: Weighting) -> Self {
        if weighting == Weighting::Plain && observations.noise_source == Some(NoiseSource::Holds) {
            return Self::new(observations, model, Weighting::MeasuredNoise).unweighted(observations);
        }
        let starting_values =
            PilotSearch::new(observations, weighting).starting_values(observations, model).swap_remove(0);
        // What an error of the angle does to the torque hangs on the damping, of which a look knows the magnitude at best.
        let (objective, covariances) =
            objective(observations, weighting, Some(&starting_values.median_values()));
        let mut fit =
            Self::from_starting_values(observations, model, objective, covariances, &starting_values);
        fit.search_multistart(observations);
        fit
    }

    /// Half the sum of squares of all trials, what they shrinkage_target on included.
    pub fn cost(&self) -> f64 {
        self.solution.cost()
    }

    /// The same fit with all samples alike, from where this one ended.
    pub fn unweighted(mut self, observations: &Observations) -> Self {
        self.objective = Objective::LeastSquares;
        let start = &self.solution.coordinates;
        self.solution = solve(
            observations,
            &self.parameterisation,
            &self.kinds,
            &self.objective,
            start,
            SolverOptions::default(),
        );
        self.update_parameters();
        self.search_multistart(observations);
        self
    }

    /// Fits `model` from given first values, without looking for other optima; see [`Fit::search_multistart`].
    pub fn from_starting_values(
        observations: &Observations,
        model: &Model,
        objective: Objective,
        covariances: Vec<NoiseCovariance>,
        starting_values: &StartingValues,
    ) -> Self {
        let parameterisation = Parameterisation::new(observations, model, starting_values);
        let start = parameterisation.start();
        Self::from_start(observations, model, parameterisation, objective, covariances, &start)
    }

    /// Fits `model` in its `parameterisation` from given coordinates.
    pub fn from_start(
        observations: &Observations,
        model: &Model,
        parameterisation: Parameterisation,
        objective: Objective,
        covariances: Vec<NoiseCovariance>,
        start: &[f64],
    ) -> Self {
        let kinds = model.kinds();
        let solution =
            solve(observations, &parameterisation, &kinds, &objective, start, SolverOptions::default());
        let mut fit = Self {
            model: model.clone(),
            kinds,
            parameterisation,
            objective,
            residual_covariances: covariances,
            solution,
            parameters: Vec::new(),
            shrinkage_target: None,
            ambiguous_trials: Vec::new(),
        };
        fit.update_parameters();
        fit
    }

    /// The same fit with another solution of its parameterisation.
    pub fn at_solution(&self, solution: Solution) -> Self {
        let mut fit = Self { solution, ..self.clone() };
        fit.update_parameters();
        fit
    }

    /// A model that adds mechanisms to this fit's, fitted from where this fit ended.
    pub fn extended(&self, observations: &Observations, model: &Model) -> Self {
        self.extended_by(observations, model, EXTENSION)
    }

    pub(in crate::fit) fn extended_by(
        &self,
        observations: &Observations,
        model: &Model,
        options: SolverOptions,
    ) -> Self {
        let starting_values = StartingValues::at(observations, &self.parameters);
        let mut parameterisation = Parameterisation::new(observations, model, &starting_values);
        if let Some(shrinkage_target) = &self.shrinkage_target {
            parameterisation.shrinkage_target(shrinkage_target, &LEAN);
        }
        let mut start = parameterisation.start();
        for (trial, links) in parameterisation.transforms.iter().enumerate() {
            for (parameter, link) in links.iter().enumerate().take(self.parameters[trial].len()) {
                let value = self.parameters[trial][parameter];
                let (coordinate, at) = match link {
                    Transform::Logarithmic { coordinate, factor } => (*coordinate, libm::log(value / factor)),
                    Transform::Sum(terms) if terms.len() == 1 => (terms[0].0, value / terms[0].1),
                    _ => continue,
                };
                let bounds = &parameterisation.coordinates[coordinate];
                start[coordinate] = at.clamp(bounds.low, bounds.high);
            }
        }
        self.descended(observations, model, parameterisation, &start, options)
    }

    /// The same fit with one of its mechanisms taken out and all else left where it is: a place to look from for another.
    ///
    /// # Panics
    /// If it does not have the mechanism.
    pub fn without(&self, observations: &Observations, kind: MechanismKind) -> Self {
        let place = self.kinds.iter().position(|own| *own == kind).expect("a mechanism of this fit");
        let mut model = self.model.clone();
        model.mechanisms.remove(place);
        let before: usize = self.kinds[..place].iter().map(|own| own.parameter_count()).sum();
        let own = BASE_PARAMETERS.len() + before..BASE_PARAMETERS.len() + before + kind.parameter_count();
        let mut left = self.clone();
        left.parameters.iter_mut().for_each(|parameters| drop(parameters.drain(own.clone())));
        left.extended_by(observations, &model, SolverOptions { max_iterations: 1, ..EXTENSION })
    }

    /// `model` in its `parameterisation`, weighed as this fit is, from given coordinates as far down as `options` goes.
    pub(in crate::fit) fn descended(
        &self,
        observations: &Observations,
        model: &Model,
        parameterisation: Parameterisation,
        start: &[f64],
        options: SolverOptions,
    ) -> Self {
        let kinds = model.kinds();
        let solution = solve(observations, &parameterisation, &kinds, &self.objective, start, options);
        let fit = Self {
            model: model.clone(),
            kinds,
            parameterisation,
            ambiguous_trials: Vec::new(),
            ..self.clone()
        };
        fit.at_solution(solution)
    }

    /// `model` fitted to `some` of the trials that this fit was made on, from where it ended; `trials` says which they are here.
    pub fn on(&self, some: &Observations, trials: &[usize], model: &Model) -> Self {
        self.of(trials).extended(some, model)
    }

    /// Where this fit ended in some of its trials, as a start for theirs alone.
    pub(in crate::fit) fn of(&self, trials: &[usize]) -> Self {
        let parameters = trials.iter().map(|trial| self.parameters[*trial].clone()).collect();
        let shrinkage_target =
            self.shrinkage_target.as_ref().map(|starting_values| starting_values.subset(trials));
        Self { parameters, shrinkage_target, ..self.clone() }
    }

    pub(in crate::fit) fn update_parameters(&mut self) {
        self.parameters = (0..self.parameterisation.transforms.len())
            .map(|trial| {
                let mut own = Vec::new();
                self.parameterisation.parameters(trial, &self.solution.coordinates, &mut own);
                own
            })
            .collect();
    }

    /// What became of the optimisation that a trial took part in.
    pub fn outcome(&self, trial: usize) -> ComponentOutcome {
        let component =
            self.parameterisation.components.iter().position(|component| component.trials.contains(&trial));
        self.solution.outcomes[component.unwrap_or(0)]
    }

    /// Whether a trial's parameter ended at a bound.
    pub fn at_bound(&self, trial: usize, parameter: usize) -> bool {
        let mut at_bound = false;
        self.parameterisation.slopes(trial, parameter, 1.0, |coordinate, _| {
            let (c, x) =
                (&self.parameterisation.coordinates[coordinate], self.solution.coordinates[coordinate]);
            at_bound |= x <= c.low + 1e-6 || x >= c.high - 1e-6;
        });
        at_bound
    }
}

/// An extension starts where the fit before it ended.
const EXTENSION: SolverOptions = SolverOptions { max_iterations: 40, tolerance: 1e-4, max_log_step: 0.7 };

/// Index of k_srs, k_dec and x_e in a trial's parameters.
pub const K_SRS: usize = 3;
pub(in crate::fit) const K_DEC: usize = 4;
/// See [`K_SRS`].
pub const X_E: usize = 5;

/// What to minimise, and the covariance of the residuals where one could be measured; `point` as for [`covariances`].
///
/// Only noise measured in holds weighs the residuals: what differs between repetitions is more than noise.
pub fn objective(
    observations: &Observations,
    weighting: Weighting,
    point: Option<&[f64; 6]>,
) -> (Objective, Vec<NoiseCovariance>) {
    let (Some(point), Some(source)) = (point, observations.noise_source) else {
        return (Objective::LeastSquares, Vec::new());
    };
    match (source, weighting) {
        (NoiseSource::Repetitions, _) => (Objective::LeastSquares, observations.noise_covariances.clone()),
        (_, Weighting::Plain) => (Objective::LeastSquares, covariances(observations, point)),
        (_, Weighting::MeasuredNoise) => {
            let covariances = covariances(observations, point);
            (Objective::Whitened(whiteners(observations, &covariances)), covariances)
        }
    }
}
