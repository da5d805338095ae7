//! A whole fit: weights, start, solution, and a second look at trials that may have several optima.

use crate::fit::data::hold_noise::NoiseSource;
use crate::fit::data::preprocessing::Prepared;
use crate::fit::model::specification::Model;
use crate::fit::parameters::parameterisation::{Layout, Link};
use crate::fit::residuals::residual_covariance::{covariances, whiteners};
use crate::fit::search::pilot_search::FirstLook;
use crate::fit::search::shrinkage::LEAN;
use crate::fit::search::starting_values::Guess;
use crate::fit::solver::levenberg_marquardt::{Effort, Outcome, Solution, solve};
use crate::fit::solver::normal_equations::Objective;
use crate::signal::Noise;
use crate::wrist::BASE_PARAMETERS;
use crate::wrist::mechanisms::Kind;

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
    pub kinds: Vec<Kind>,
    /// Its coordinates.
    pub layout: Layout,
    /// What was minimised.
    pub objective: Objective,
    /// The covariance of the residuals, one a noise of the session; empty where none could be measured.
    pub covariances: Vec<Noise>,
    /// The optimum.
    pub solution: Solution,
    /// Each trial's parameters at the optimum, in the order of [`Model::parameter_names`].
    pub parameters: Vec<Vec<f64>>,
    /// What single trials lean on where their own data hardly tell.
    pub lean: Option<Guess>,
    /// Trials with another optimum that the data do not tell apart from this one.
    pub several: Vec<usize>,
}

impl Fit {
    /// Fits `model`.
    ///
    /// A plain fit starts where the weighed one ends, if there is a noise to weigh by: the plain sum of squares has many
    /// optima that the noise does not tell apart, and this is the one that the data know.
    pub fn new(prepared: &Prepared, model: &Model, weighting: Weighting) -> Self {
        if weighting == Weighting::Plain && prepared.noise_source == Some(NoiseSource::Holds) {
            return Self::new(prepared, model, Weighting::MeasuredNoise).plainly(prepared);
        }
        let guess = FirstLook::new(prepared, weighting).guesses(prepared, model).swap_remove(0);
        // What an error of the angle does to the torque hangs on the damping, of which a look knows the magnitude at best.
        let (objective, covariances) = objective(prepared, weighting, Some(&guess.middle()));
        let mut fit = Self::from_guess(prepared, model, objective, covariances, &guess);
        fit.look_again(prepared);
        fit
    }

    /// Half the sum of squares of all trials, what they lean on included.
    pub fn cost(&self) -> f64 {
        self.solution.cost()
    }

    /// The same fit with all samples alike, from where this one ended.
    pub fn plainly(mut self, prepared: &Prepared) -> Self {
        self.objective = Objective::LeastSquares;
        let start = &self.solution.coordinates;
        self.solution = solve(prepared, &self.layout, &self.kinds, &self.objective, start, Effort::default());
        self.take_parameters();
        self.look_again(prepared);
        self
    }

    /// Fits `model` from given first values, without looking for other optima; see [`Fit::look_again`].
    pub fn from_guess(
        prepared: &Prepared,
        model: &Model,
        objective: Objective,
        covariances: Vec<Noise>,
        guess: &Guess,
    ) -> Self {
        let layout = Layout::new(prepared, model, guess);
        let start = layout.start();
        Self::from_start(prepared, model, layout, objective, covariances, &start)
    }

    /// Fits `model` in its `layout` from given coordinates.
    pub fn from_start(
        prepared: &Prepared,
        model: &Model,
        layout: Layout,
        objective: Objective,
        covariances: Vec<Noise>,
        start: &[f64],
    ) -> Self {
        let kinds = model.kinds();
        let solution = solve(prepared, &layout, &kinds, &objective, start, Effort::default());
        let mut fit = Self {
            model: model.clone(),
            kinds,
            layout,
            objective,
            covariances,
            solution,
            parameters: Vec::new(),
            lean: None,
            several: Vec::new(),
        };
        fit.take_parameters();
        fit
    }

    /// The same fit with another solution of its layout.
    pub fn with_solution(&self, solution: Solution) -> Self {
        let mut fit = Self { solution, ..self.clone() };
        fit.take_parameters();
        fit
    }

    /// A model that adds mechanisms to this fit's, fitted from where this fit ended.
    pub fn extended(&self, prepared: &Prepared, model: &Model) -> Self {
        self.extended_by(prepared, model, EXTENSION)
    }

    pub(in crate::fit) fn extended_by(&self, prepared: &Prepared, model: &Model, effort: Effort) -> Self {
        let guess = Guess::at(prepared, &self.parameters);
        let mut layout = Layout::new(prepared, model, &guess);
        if let Some(lean) = &self.lean {
            layout.lean(lean, &LEAN);
        }
        let mut start = layout.start();
        for (trial, links) in layout.links.iter().enumerate() {
            for (parameter, link) in links.iter().enumerate().take(self.parameters[trial].len()) {
                let value = self.parameters[trial][parameter];
                let (coordinate, at) = match link {
                    Link::Logarithmic { coordinate, factor } => (*coordinate, libm::log(value / factor)),
                    Link::Sum(terms) if terms.len() == 1 => (terms[0].0, value / terms[0].1),
                    _ => continue,
                };
                let bounds = &layout.coordinates[coordinate];
                start[coordinate] = at.clamp(bounds.low, bounds.high);
            }
        }
        self.descended(prepared, model, layout, &start, effort)
    }

    /// The same fit with one of its mechanisms taken out and all else left where it is: a place to look from for another.
    ///
    /// # Panics
    /// If it does not have the mechanism.
    pub fn without(&self, prepared: &Prepared, kind: Kind) -> Self {
        let place = self.kinds.iter().position(|own| *own == kind).expect("a mechanism of this fit");
        let mut model = self.model.clone();
        model.mechanisms.remove(place);
        let before: usize = self.kinds[..place].iter().map(|own| own.parameter_count()).sum();
        let own = BASE_PARAMETERS.len() + before..BASE_PARAMETERS.len() + before + kind.parameter_count();
        let mut left = self.clone();
        left.parameters.iter_mut().for_each(|parameters| drop(parameters.drain(own.clone())));
        left.extended_by(prepared, &model, Effort { iterations: 1, ..EXTENSION })
    }

    /// `model` in its `layout`, weighed as this fit is, from given coordinates as far down as `effort` goes.
    pub(in crate::fit) fn descended(
        &self,
        prepared: &Prepared,
        model: &Model,
        layout: Layout,
        start: &[f64],
        effort: Effort,
    ) -> Self {
        let kinds = model.kinds();
        let solution = solve(prepared, &layout, &kinds, &self.objective, start, effort);
        let fit = Self { model: model.clone(), kinds, layout, several: Vec::new(), ..self.clone() };
        fit.with_solution(solution)
    }

    /// `model` fitted to `some` of the trials that this fit was made on, from where it ended; `trials` says which they are here.
    pub fn on(&self, some: &Prepared, trials: &[usize], model: &Model) -> Self {
        self.of(trials).extended(some, model)
    }

    /// Where this fit ended in some of its trials, as a start for theirs alone.
    pub(in crate::fit) fn of(&self, trials: &[usize]) -> Self {
        let parameters = trials.iter().map(|trial| self.parameters[*trial].clone()).collect();
        let lean = self.lean.as_ref().map(|guess| guess.only(trials));
        Self { parameters, lean, ..self.clone() }
    }

    pub(in crate::fit) fn take_parameters(&mut self) {
        self.parameters = (0..self.layout.links.len())
            .map(|trial| {
                let mut own = Vec::new();
                self.layout.parameters(trial, &self.solution.coordinates, &mut own);
                own
            })
            .collect();
    }

    /// What became of the optimisation that a trial took part in.
    pub fn outcome(&self, trial: usize) -> Outcome {
        let component = self.layout.components.iter().position(|component| component.trials.contains(&trial));
        self.solution.outcomes[component.unwrap_or(0)]
    }

    /// Whether a trial's parameter ended at a bound.
    pub fn at_bound(&self, trial: usize, parameter: usize) -> bool {
        let mut at_bound = false;
        self.layout.slopes(trial, parameter, 1.0, |coordinate, _| {
            let (c, x) = (&self.layout.coordinates[coordinate], self.solution.coordinates[coordinate]);
            at_bound |= x <= c.low + 1e-6 || x >= c.high - 1e-6;
        });
        at_bound
    }
}

/// An extension starts where the fit before it ended.
const EXTENSION: Effort = Effort { iterations: 40, decrease: 1e-4, longest_step: 0.7 };

/// Index of k_srs, k_dec and x_e in a trial's parameters.
pub const STIFFNESS: usize = 3;
pub(in crate::fit) const DECREMENT: usize = 4;
/// See [`STIFFNESS`].
pub const ELASTIC_LIMIT: usize = 5;

/// What to minimise, and the covariance of the residuals where one could be measured; `point` as for [`covariances`].
///
/// Only noise measured in holds weighs the residuals: what differs between repetitions is more than noise.
pub fn objective(
    prepared: &Prepared,
    weighting: Weighting,
    point: Option<&[f64; 6]>,
) -> (Objective, Vec<Noise>) {
    let (Some(point), Some(source)) = (point, prepared.noise_source) else {
        return (Objective::LeastSquares, Vec::new());
    };
    match (source, weighting) {
        (NoiseSource::Repetitions, _) => (Objective::LeastSquares, prepared.noises.clone()),
        (_, Weighting::Plain) => (Objective::LeastSquares, covariances(prepared, point)),
        (_, Weighting::MeasuredNoise) => {
            let covariances = covariances(prepared, point);
            (Objective::Whitened(whiteners(prepared, &covariances)), covariances)
        }
    }
}
