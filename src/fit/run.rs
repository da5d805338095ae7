//! A whole fit: weights, start, solution, and a second look at trials that may have several optima.

use nalgebra::{Matrix3, Vector3};

use super::guess::{Guess, looks};
use super::layout::{Layout, Link};
use super::model::{Model, Treatment};
use super::noise::NoiseSource;
use super::normal::Objective;
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

/// What first guesses are made from, whatever the model: the pilot's best points, and weights that go with them.
pub struct FirstLook {
    points: Vec<[f64; 6]>,
    objective: Objective,
}

impl FirstLook {
    /// Looks at a session.
    pub fn new(prepared: &Prepared, weighting: Weighting) -> Self {
        let points = looks(prepared);
        let (objective, _) = objective(prepared, weighting, points.first());
        Self { points, objective }
    }

    fn guesses(&self, prepared: &Prepared, model: &Model) -> Vec<Guess> {
        Guess::pooled(prepared, &self.objective, &self.points, model)
    }
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

    /// Fits a model that adds a mechanism to this fit's, with this fit's weights: from first guesses of its own, since where this
    /// fit ended may be far off if it lacks what the model has, and from there, since what it lacks may be small. `models` are
    /// the same but for the values that the mechanism starts from. Looks for other optima only on the way to [`Fit::settled`].
    ///
    /// Once all parameters start together, and once those of the mechanism are held until the others have come to terms
    /// with them: free from the beginning they run off to make up for yields that are in the wrong place. A few trials tell
    /// which start leads furthest down.
    ///
    /// # Panics
    /// If there are no models.
    pub fn rival(&self, prepared: &Prepared, first: &FirstLook, models: &[Model]) -> Self {
        let some = Sample::of(prepared);
        let few = prepared.only(&some.trials);
        let parameters = some.trials.iter().map(|trial| self.parameters[*trial].clone()).collect();
        let here = Self { parameters, lean: None, ..self.clone() };
        let from = |model: &Model, guess: &Guess| {
            let layout = Layout::new(&few, model, &guess.only(&some.trials));
            let start = layout.start();
            here.descended(&few, model, layout, &start, GLANCE)
        };
        let starts = |model: &Model| {
            let mut held = model.clone();
            if let Some(added) = held.mechanisms.last_mut() {
                for (treatment, parameter) in added.parameters.iter_mut().zip(added.kind.parameters()) {
                    *treatment = Treatment::fixed(treatment.value.unwrap_or(parameter.typical));
                }
            }
            let free = first.guesses(prepared, model).into_iter().take(1).map(|guess| from(model, &guess));
            let released = first
                .guesses(prepared, &held)
                .into_iter()
                .take(2)
                .map(|guess| from(&held, &guess).extended_by(&few, model, GLANCE));
            let mut all: Vec<Self> = free.chain(released).collect();
            all.push(here.extended_by(&few, model, GLANCE));
            all
        };
        let mut starts: Vec<Self> = models.iter().flat_map(starts).collect();
        starts.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        let within = starts[0].cost() * (1.0 + GLANCE_ERROR);
        let to_the_end = |fit: &Self| {
            let parameters = some.like.iter().map(|own| fit.parameters[*own].clone()).collect();
            Self { parameters, ..fit.clone() }.extended(prepared, &fit.model)
        };
        let (best, others) = starts.split_first().expect("at least one model");
        let others = others.iter().take_while(|fit| fit.cost() <= within).map(to_the_end);
        let best =
            others.fold(to_the_end(best), |best, own| if own.cost() < best.cost() { own } else { best });
        best.leaning(prepared).regrouped(prepared)
    }

    /// The better of this fit and the one from where all yields lie elsewhere at once.
    fn regrouped(self, prepared: &Prepared) -> Self {
        let mut other = self.clone();
        other.look_together(prepared);
        if other.solution.coordinates == self.solution.coordinates {
            return self;
        }
        other.take_parameters();
        let other = other.leaning(prepared);
        if other.cost() < self.cost() { other } else { self }
    }

    /// Half the sum of squares of all trials, what they lean on included.
    pub fn cost(&self) -> f64 {
        self.solution.cost()
    }

    /// The optimum after a second look, with the yields of single trials leaning on those of all: what a diagnosis compares,
    /// since a yield that one trial's data leave open would hide or feign a misfit of the model.
    pub fn settled(mut self, prepared: &Prepared) -> Self {
        self.look_again(prepared);
        self.leaning(prepared)
    }

    /// The same fit with the yields of single trials leaning on those of all, and these on what they then are.
    pub fn leaning(&self, prepared: &Prepared) -> Self {
        let leant = |fit: &Self| {
            let fit = Self { lean: Some(lean(prepared, fit)), ..fit.clone() };
            fit.extended(prepared, &fit.model)
        };
        let mut best = leant(self);
        for _ in 0..LEANINGS {
            let next = leant(&best);
            if next.cost() > best.cost() - WORTH_LEANING {
                break;
            }
            best = next;
        }
        best
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

    fn extended_by(&self, prepared: &Prepared, model: &Model, effort: Effort) -> Self {
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

    /// `model` in its `layout`, weighed as this fit is, from given coordinates as far down as `effort` goes.
    fn descended(
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

    /// `model` fitted to some of the trials that this fit was made on, from where it ended.
    pub fn on(&self, prepared: &Prepared, trials: &[usize], model: &Model) -> Self {
        let parameters = trials.iter().map(|trial| self.parameters[*trial].clone()).collect();
        let lean = self.lean.as_ref().map(|guess| guess.only(trials));
        Self { parameters, lean, ..self.clone() }.extended(&prepared.only(trials), model)
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

/// What single trials lean on: the regression of the logarithms on those of velocity and torque, over the trials whose own
/// data tell, each by how well they do.
fn lean(prepared: &Prepared, fit: &Fit) -> Guess {
    let uncertainties = uncertainties(prepared, fit, &predictions(prepared, fit));
    let mut parameters = fit.parameters.clone();
    let sizes = |trial: usize| {
        let own = &prepared.trials[trial];
        [own.velocity_rad_s, own.torque_nm].map(|size| libm::log(size.abs().max(1e-3)))
    };
    let trials = prepared.trials.len();
    let mean = [0, 1].map(|which| (0..trials).map(|t| sizes(t)[which]).sum::<f64>() / trials as f64);
    let design = |trial: usize| {
        let own = sizes(trial);
        Vector3::new(1.0, own[0] - mean[0], own[1] - mean[1])
    };
    for (parameter, sd) in LEAN {
        // Few trials that tell may lie on a line: without a bound on its slopes the plane would fall off beside it.
        let mut square = Matrix3::from_diagonal(&Vector3::new(0.0, STEEPEST, STEEPEST));
        let mut right = Vector3::zeros();
        for (trial, own) in uncertainties.iter().enumerate() {
            let Some(se) = own.se[parameter].filter(|se| *se < 1.0) else { continue };
            let x = design(trial);
            let weight = 1.0 / (se * se + sd * sd);
            square += weight * x * x.transpose();
            right += weight * libm::log(fit.parameters[trial][parameter]) * x;
        }
        let Some(coefficients) = square.cholesky().map(|factor| factor.solve(&right)) else { continue };
        for (trial, own) in parameters.iter_mut().enumerate() {
            own[parameter] = libm::exp(coefficients.dot(&design(trial)));
        }
    }
    Guess::at(prepared, &parameters)
}

/// Most times that trials lean anew on where they came to, and the decrease of the cost that is worth another time.
const LEANINGS: usize = 4;
const WORTH_LEANING: f64 = 0.5;

/// How unlikely steep powers of velocity and torque are, as one over the variance of the power: k_dec and x_e go with
/// powers between minus and plus one.
const STEEPEST: f64 = 1.0;

/// How far single trials' k_dec and x_e may be expected from those of all, as standard deviations of their logarithms.
const LEAN: [(usize, f64); 2] = [(4, 0.4), (ELASTIC_LIMIT, 0.2)];

/// An extension starts where the fit before it ended.
const EXTENSION: Effort = Effort { iterations: 40, decrease: 1e-4, longest_step: 0.7 };

/// Trials that stand for all: some of each condition.
struct Sample {
    trials: Vec<usize>,
    /// For each trial of the session, the place of the one that stands for it.
    like: Vec<usize>,
}

/// About how many trials a glance needs.
const GLANCED_AT: usize = 12;

impl Sample {
    fn of(prepared: &Prepared) -> Self {
        let conditions: Vec<usize> = prepared.trials.iter().map(|trial| trial.condition).collect();
        let mut distinct = conditions.clone();
        distinct.sort_unstable();
        distinct.dedup();
        let of_each = GLANCED_AT.div_ceil(distinct.len().max(1));
        let mut some = Self { trials: Vec::new(), like: Vec::new() };
        for (trial, condition) in conditions.iter().enumerate() {
            let alike: Vec<usize> = (0..some.trials.len())
                .filter(|place| conditions[some.trials[*place]] == *condition)
                .collect();
            if alike.len() < of_each {
                some.like.push(some.trials.len());
                some.trials.push(trial);
            } else {
                some.like.push(alike[trial % of_each]);
            }
        }
        some
    }
}

/// Which of several starts leads furthest down shows long before its end; those stay that are behind by less than this part of
/// the cost.
const GLANCE: Effort = Effort { iterations: 15, decrease: 2e-3, longest_step: 0.7 };
const GLANCE_ERROR: f64 = 0.06;

/// Index of k_srs, k_dec and x_e in a trial's parameters.
pub(super) const STIFFNESS: usize = 3;
pub(super) const DECREMENT: usize = 4;
pub(super) const ELASTIC_LIMIT: usize = 5;

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
