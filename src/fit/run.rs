//! A whole fit: weights, start, solution, a second look at trials with several optima, and how well all is known.

use nalgebra::{Matrix3, Vector3};

use super::guess::{Guess, looks};
use super::layout::{Layout, Link};
use super::model::{Model, Scope};
use super::normal::{Objective, trial_costs};
use super::prepare::Prepared;
use super::solve::{Effort, Outcome, Solution, solve};
use super::uncertainty::{predictions, uncertainties};
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
    /// What single trials lean on where their own data hardly tell.
    pub lean: Option<Guess>,
    /// Trials with another optimum that the data do not tell apart from this one.
    pub several: Vec<usize>,
}

/// Two optima closer than this in half the sum of squares, in units of the noise, are not told apart (95 % of chi-square
/// with one degree of freedom).
const NOT_TOLD_APART: f64 = 1.92;

/// Elastic limits that the second look starts from, as parts of the way that the motor goes in the window.
const SECOND_LOOKS: [f64; 4] = [0.25, 0.4, 0.55, 0.75];

impl Fit {
    /// Fits `model`.
    pub fn new(prepared: &Prepared, model: &Model, weighting: Weighting) -> Self {
        let points = looks(prepared);
        let (objective, covariances) = objective(prepared, weighting, &points);
        let guess = Guess::pooled(prepared, &objective, &points);
        let mut fit = Self::from_guess(prepared, model, objective, covariances, &guess);
        fit.look_again(prepared, &guess);
        fit
    }

    /// Fits `model` with the yields of single trials leaning on those of all: what a diagnosis starts from, since a yield
    /// that one trial's data leave open would hide or feign a misfit of the model.
    pub fn leaning(prepared: &Prepared, model: &Model) -> Self {
        let first = Self::new(prepared, model, Weighting::MeasuredNoise);
        let lean = lean(prepared, &first);
        Self { lean: Some(lean), ..first }.extended(prepared, model)
    }

    /// Fits `model` from given first values, without looking for other optima.
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
        let guess = Guess::at(prepared, &self.parameters);
        let kinds = model.kinds();
        let mut layout = Layout::new(prepared, model, &guess);
        if let Some(lean) = &self.lean {
            layout.lean(lean, &LEAN);
        }
        let mut start = layout.start();
        for (trial, links) in layout.links.iter().enumerate() {
            for (parameter, link) in links.iter().enumerate().take(self.parameters[trial].len()) {
                if let Link::Logarithmic { coordinate, factor } = link {
                    let bounds = &layout.coordinates[*coordinate];
                    start[*coordinate] =
                        libm::log(self.parameters[trial][parameter] / factor).clamp(bounds.low, bounds.high);
                }
            }
        }
        let solution = solve(prepared, &layout, &kinds, &self.objective, &start, EXTENSION);
        let fit = Self { model: model.clone(), kinds, layout, several: Vec::new(), ..self.clone() };
        fit.with_solution(solution)
    }

    /// `model` fitted to some of the trials that this fit was made on, from where it ended.
    pub fn on(&self, prepared: &Prepared, trials: &[usize], model: &Model) -> Self {
        let parameters = trials.iter().map(|trial| self.parameters[*trial].clone()).collect();
        let lean = self.lean.as_ref().map(|guess| guess.only(trials));
        Self { parameters, lean, ..self.clone() }.extended(&prepared.only(trials), model)
    }

    /// Starts the yields from several places, gives each block of trials the best that was found, and polishes.
    fn look_again(&mut self, prepared: &Prepared, guess: &Guess) {
        let treatment = &self.model.base[ELASTIC_LIMIT];
        if !matches!(treatment.scope, Scope::Trial | Scope::Condition) || !treatment.law.is_empty() {
            return;
        }
        let mut looks = vec![self.look(prepared, &self.solution.coordinates)];
        for place in SECOND_LOOKS {
            looks.push(self.look(prepared, &self.start_with_yield_at(place, guess)));
        }
        let mut merged = self.solution.coordinates.clone();
        self.each_block(|_, coordinates, trials| {
            let best = looks.iter().min_by(|a, b| a.cost(trials).total_cmp(&b.cost(trials)));
            for coordinate in coordinates {
                merged[*coordinate] =
                    best.map_or(merged[*coordinate], |look| look.solution.coordinates[*coordinate]);
            }
        });
        looks.push(self.look(prepared, &merged));
        for (index, component) in self.layout.components.iter().enumerate() {
            let best = looks
                .iter()
                .min_by(|a, b| a.solution.outcomes[index].cost.total_cmp(&b.solution.outcomes[index].cost));
            let Some(best) = best else { continue };
            for coordinate in component.order() {
                self.solution.coordinates[coordinate] = best.solution.coordinates[coordinate];
            }
            self.solution.outcomes[index] = best.solution.outcomes[index];
        }
        self.find_several(prepared, &looks);
        self.take_parameters();
    }

    fn look(&self, prepared: &Prepared, start: &[f64]) -> Look {
        let solution = solve(prepared, &self.layout, &self.kinds, &self.objective, start, Effort::default());
        let costs = trial_costs(prepared, &self.layout, &self.kinds, &self.objective, &solution.coordinates);
        Look { solution, costs }
    }

    /// The start with the elastic limits at `place`, a part of the way that the motor goes in the window.
    fn start_with_yield_at(&self, place: f64, guess: &Guess) -> Vec<f64> {
        let mut start = self.layout.start();
        for (trial, links) in self.layout.links.iter().enumerate() {
            if let Link::Logarithmic { coordinate, .. } = links[ELASTIC_LIMIT] {
                let bounds = &self.layout.coordinates[coordinate];
                start[coordinate] = libm::log(place * guess.reach_rad(trial)).clamp(bounds.low, bounds.high);
            }
        }
        start
    }

    /// Calls `each` with the component, the coordinates and the trials of every block.
    fn each_block(&self, mut each: impl FnMut(usize, &[usize], &[usize])) {
        for (index, component) in self.layout.components.iter().enumerate() {
            for (block, coordinates) in component.blocks.iter().enumerate() {
                let own =
                    component.trials.iter().zip(&component.block_of_trial).filter(|(_, b)| **b == block);
                let trials: Vec<usize> = own.map(|(trial, _)| *trial).collect();
                each(index, coordinates, &trials);
            }
        }
    }

    /// Notes the trials whose yield another look put elsewhere at a cost that the noise does not tell apart.
    fn find_several(&mut self, prepared: &Prepared, looks: &[Look]) {
        let reached =
            trial_costs(prepared, &self.layout, &self.kinds, &self.objective, &self.solution.coordinates);
        let mut several = Vec::new();
        self.each_block(|_, coordinates, trials| {
            let cost: f64 = trials.iter().map(|trial| reached[*trial]).sum();
            let unit = match self.objective {
                Objective::Whitened(_) => 1.0,
                Objective::LeastSquares => cost / (trials.len() as f64 * INDEPENDENT_VALUES),
            };
            let limit = coordinates.iter().find(|c| self.layout.coordinates[**c].parameter == ELASTIC_LIMIT);
            let Some(limit) = limit else { return };
            let elsewhere = |look: &Look| {
                look.cost(trials) - cost < NOT_TOLD_APART * unit
                    && (look.solution.coordinates[*limit] - self.solution.coordinates[*limit]).abs()
                        > ELSEWHERE
            };
            if looks.iter().any(elsewhere) {
                several.extend_from_slice(trials);
            }
        });
        several.sort_unstable();
        self.several = several;
    }

    fn take_parameters(&mut self) {
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

/// What single trials lean on: the regression of the logarithms on those of velocity and torque, over the trials whose own
/// data tell, each by how well they do.
fn lean(prepared: &Prepared, fit: &Fit) -> Guess {
    let uncertainties = uncertainties(prepared, fit, &predictions(prepared, fit));
    let mut parameters = fit.parameters.clone();
    let design = |trial: usize| {
        let own = &prepared.trials[trial];
        [1.0, libm::log(own.velocity_rad_s.abs().max(1e-3)), libm::log(own.torque_nm.abs().max(1e-3))]
    };
    for (parameter, sd) in LEAN {
        let mut square = Matrix3::from_diagonal_element(1e-9);
        let mut right = Vector3::zeros();
        for trial in 0..prepared.trials.len() {
            let Some(se) = uncertainties[trial].se[parameter].filter(|se| *se < 1.0) else { continue };
            let x = Vector3::from(design(trial));
            let weight = 1.0 / (se * se + sd * sd);
            square += weight * x * x.transpose();
            right += weight * libm::log(fit.parameters[trial][parameter]) * x;
        }
        let Some(coefficients) = square.cholesky().map(|factor| factor.solve(&right)) else { continue };
        for (trial, own) in parameters.iter_mut().enumerate() {
            own[parameter] = libm::exp(coefficients.dot(&Vector3::from(design(trial))));
        }
    }
    Guess::at(prepared, &parameters)
}

/// How far single trials' k_dec and x_e may be expected from those of all, as standard deviations of their logarithms.
const LEAN: [(usize, f64); 2] = [(4, 0.2), (ELASTIC_LIMIT, 0.1)];

/// An extension starts where the fit before it ended.
const EXTENSION: Effort = Effort { iterations: 40, decrease: 1e-4, longest_step: 0.7 };

/// Index of x_e in a trial's parameters.
const ELASTIC_LIMIT: usize = 5;

/// A change of log x_e that makes another optimum.
const ELSEWHERE: f64 = 0.25;

/// About how many independent values the paper's filter leaves in its window.
const INDEPENDENT_VALUES: f64 = 4.5;

/// A solution with the cost of each trial.
struct Look {
    solution: Solution,
    costs: Vec<f64>,
}

impl Look {
    fn cost(&self, trials: &[usize]) -> f64 {
        trials.iter().map(|trial| self.costs[*trial]).sum()
    }
}

/// What to minimise, and the noise it is weighed by.
pub fn objective(prepared: &Prepared, weighting: Weighting, points: &[[f64; 6]]) -> (Objective, Vec<Noise>) {
    let covariances = match points.first() {
        Some(point) if !prepared.noises.is_empty() => covariances(prepared, point),
        _ => return (Objective::LeastSquares, Vec::new()),
    };
    match weighting {
        Weighting::Plain => (Objective::LeastSquares, covariances),
        Weighting::MeasuredNoise => (Objective::Whitened(whiteners(prepared, &covariances)), covariances),
    }
}
