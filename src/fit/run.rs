//! A whole fit: weights, start, solution, and a second look at trials that may have several optima.

use super::guess::{Guess, looks};
use super::layout::Layout;
use super::model::Model;
use super::noise::NoiseSource;
use super::normal::Objective;
use super::prepare::Prepared;
use super::solve::{Effort, Outcome, Solution, solve};
use super::weights::{covariances, whiteners};
use crate::signal::Noise;
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
            let mut fit = Self::new(prepared, model, Weighting::MeasuredNoise);
            fit.objective = Objective::LeastSquares;
            let (kinds, start) = (&fit.kinds, &fit.solution.coordinates);
            fit.solution = solve(prepared, &fit.layout, kinds, &fit.objective, start, Effort::default());
            fit.take_parameters();
            return fit;
        }
        let points = looks(prepared);
        let (objective, covariances) = objective(prepared, weighting, &points);
        let guess = Guess::pooled(prepared, &objective, &points);
        let mut fit = Self::from_guess(prepared, model, objective, covariances, &guess);
        fit.look_again(prepared);
        fit
    }

    /// Fits `model` from given first values, without looking for other optima; see [`Fit::look_again`].
    pub fn from_guess(
        prepared: &Prepared,
        model: &Model,
        objective: Objective,
        covariances: Vec<Noise>,
        guess: &Guess,
    ) -> Self {
        let kinds = model.kinds();
        let layout = Layout::new(prepared, model, guess);
        let solution = solve(prepared, &layout, &kinds, &objective, &layout.start(), Effort::default());
        let mut fit = Self {
            model: model.clone(),
            kinds,
            layout,
            objective,
            covariances,
            solution,
            parameters: Vec::new(),
            several: Vec::new(),
        };
        fit.take_parameters();
        fit
    }

    pub(super) fn take_parameters(&mut self) {
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

/// What to minimise, and the covariance of the residuals where one could be measured.
///
/// Only noise measured in holds weighs the residuals: what differs between repetitions is more than noise.
pub fn objective(prepared: &Prepared, weighting: Weighting, points: &[[f64; 6]]) -> (Objective, Vec<Noise>) {
    let (Some(point), Some(source)) = (points.first(), prepared.noise_source) else {
        return (Objective::LeastSquares, Vec::new());
    };
    match (source, weighting) {
        (NoiseSource::Repetitions, _) => (Objective::LeastSquares, prepared.noises.clone()),
        (NoiseSource::Holds, Weighting::Plain) => (Objective::LeastSquares, covariances(prepared, point)),
        (NoiseSource::Holds, Weighting::MeasuredNoise) => {
            let covariances = covariances(prepared, point);
            (Objective::Whitened(whiteners(prepared, &covariances)), covariances)
        }
    }
}
