//! A mechanism added to a fit: of many starts a few trials tell which leads furthest down, and all trials where it ends.

use super::pilot_search::PilotSearch;
use super::starting_values::StartingValues;
use crate::fit::data::preprocessing::Observations;
use crate::fit::fitted::fit::{Fit, Weighting};
use crate::fit::model::specification::{Model, ParameterSpec, Scope};
use crate::fit::parameters::parameterisation::{Parameterisation, groups};
use crate::fit::solver::levenberg_marquardt::SolverOptions;

/// Which of ambiguous_trials starts leads furthest down shows long before its end; those stay that are behind by less than this part of
/// the cost.
const GLANCE: SolverOptions = SolverOptions { max_iterations: 15, tolerance: 2e-3, max_log_step: 0.7 };
const GLANCE_ERROR: f64 = 0.25;

/// Those that stay go on as far as tells what they predicted_gain.
const SECOND_GLANCE: SolverOptions = SolverOptions { max_iterations: 40, tolerance: 2e-4, max_log_step: 0.7 };

/// All trials go on where some of them ended within this much of the best, in units of the cost, in at most so many places whose
/// values differ by this part.
const NEAR: f64 = 25.0;
const MOST_WAYS: usize = 5;
const SAME: f64 = 0.02;

/// To start anew is worth the way to the end if it leads lower by this part of the cost.
const LOWER: f64 = 0.005;

/// About how many trials a glance needs.
const GLANCED_AT: usize = 12;

/// Where a fit stands before mechanisms are added to it, in the session and in some of its trials.
pub struct ExtensionSearch<'a> {
    observations: &'a Observations,
    first: PilotSearch,
    some: TrialSubset,
    few: Observations,
    /// The fit in those trials, and what its cost is there.
    here: Fit,
    cost: f64,
}

/// A model that adds a mechanism, a short way down from ambiguous_trials starts on some trials.
pub struct ScreenedExtension {
    /// The best first.
    starts: Vec<Fit>,
    /// What the best of them promises that the sum of squares of the whole session will lose, in units of the noise.
    pub predicted_gain: f64,
}

impl<'a> ExtensionSearch<'a> {
    /// Stands where `fit` ended.
    pub fn new(observations: &'a Observations, fit: &'a Fit) -> Self {
        let first = PilotSearch::new(observations, Weighting::MeasuredNoise);
        let some = TrialSubset::of(observations);
        let few = observations.subset(&some.trials);
        let here = Fit { shrinkage_target: None, ..fit.of(&some.trials) };
        let cost = here.extended_by(&few, &fit.model, GLANCE).cost();
        Self { observations, first, some, few, here, cost }
    }

    /// Looks a short way down from each start of the `models`, which are the same but for the values that the mechanism starts
    /// from.
    ///
    /// # Panics
    /// If there are no models.
    pub fn screen(&self, models: &[Model]) -> ScreenedExtension {
        let screening_fits =
            |model: &Model| self.here.screening_fits(&self.few, model, |model| self.starting_values(model));
        let mut starts: Vec<Fit> = models.iter().flat_map(screening_fits).collect();
        sort(&mut starts);
        let within = starts[0].cost() * (1.0 + GLANCE_ERROR);
        starts.retain(|fit| fit.cost() <= within);
        starts.iter_mut().for_each(|fit| *fit = fit.extended_by(&self.few, &fit.model, SECOND_GLANCE));
        sort(&mut starts);
        starts.insert(0, starts[0].clone().with_trials_restarted(&self.few));
        let best = starts[0].cost();
        let share = self.some.trials.len() as f64 / self.observations.trials.len() as f64;
        ScreenedExtension { starts, predicted_gain: 2.0 * (self.cost - best) / share }
    }

    /// Goes on with all trials from where the best starts led, with the weights of the fit. Looks for other optima only on the way
    /// to [`Fit::refined`].
    pub fn complete(&self, glance: &ScreenedExtension) -> Fit {
        let within = glance.starts[0].cost() + NEAR;
        let mut ways: Vec<&Fit> = Vec::new();
        for own in glance.starts.iter().take_while(|own| own.cost() <= within) {
            if ways.len() < MOST_WAYS && !ways.iter().any(|other| same(own, other)) {
                ways.push(own);
            }
        }
        let ends = ways.into_iter().map(|own| self.to_the_end(own));
        let best = ends.reduce(|best, own| if own.cost() < best.cost() { own } else { best });
        best.expect("at least one model").with_shrinkage(self.observations)
    }

    /// The better of a fit and where it leads to start anew with the mechanism at the values found: from a size that is far from
    /// the true one all yields can go astray, and the way back is closed once the size is right.
    pub fn restart(&self, fit: Fit) -> Fit {
        let starting_values = |model: &Model| self.starting_values(model);
        let released = self.here.released(&self.few, &fit.model, fit.added(), starting_values, SECOND_GLANCE);
        let mut starts: Vec<Fit> = released.collect();
        sort(&mut starts);
        let best = starts.swap_remove(0).with_trials_restarted(&self.few);
        let here = Fit { shrinkage_target: None, ..fit.of(&self.some.trials) };
        let cost = here.extended_by(&self.few, &fit.model, SECOND_GLANCE).cost();
        if best.cost() > cost * (1.0 - LOWER) {
            return fit;
        }
        let other = self.to_the_end(&best).with_shrinkage(self.observations);
        if other.cost() < fit.cost() { other } else { fit }
    }

    /// First starting_values of those trials that tell.
    fn starting_values(&self, model: &Model) -> impl Iterator<Item = StartingValues> + use<'_, 'a> {
        let all = self.first.starting_values(self.observations, model).into_iter();
        all.map(|starting_values| starting_values.subset(&self.some.trials))
    }

    /// All trials from where those that stand for them ended.
    fn to_the_end(&self, fit: &Fit) -> Fit {
        let parameters = self.some.stands_for.iter().map(|own| fit.parameters[*own].clone()).collect();
        Fit { parameters, ..fit.clone() }.extended(self.observations, &fit.model)
    }
}

fn sort(fits: &mut [Fit]) {
    fits.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
}

/// Whether two fits ended in the same optimum, as far as the mechanism goes.
fn same(one: &Fit, other: &Fit) -> bool {
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME * a.abs().max(b.abs());
    one.added().iter().zip(other.added()).all(near)
}

impl Fit {
    /// `model` a short way down from ambiguous_trials starts: from first starting_values of its own, since where this fit ended may be far off
    /// if it lacks what the model has, and from there, since what it lacks may be small.
    ///
    /// Once all parameters start together, and once those of the mechanism are held until the others have come to terms
    /// with them: free from the beginning they run off to make up for yields that are in the wrong place.
    fn screening_fits<G: Iterator<Item = StartingValues>>(
        &self,
        observations: &Observations,
        model: &Model,
        starting_values: impl Fn(&Model) -> G,
    ) -> Vec<Self> {
        let added = model
            .mechanisms
            .last()
            .into_iter()
            .flat_map(|own| own.parameters.iter().zip(own.kind.parameters()));
        let first: Vec<f64> = added.map(|(own, parameter)| own.value.unwrap_or(parameter.typical)).collect();
        let free = starting_values(model)
            .take(1)
            .map(|starting_values| self.screening_fit(observations, model, &starting_values));
        let released = self.released(observations, model, &first, &starting_values, GLANCE);
        free.chain(released)
            .chain(std::iter::once_with(|| self.extended_by(observations, model, GLANCE)))
            .collect()
    }

    /// `model` after its last mechanism was held at these values until the others had come to terms with them.
    fn released<G: Iterator<Item = StartingValues>>(
        &self,
        observations: &Observations,
        model: &Model,
        values: &[f64],
        starting_values: impl Fn(&Model) -> G,
        options: SolverOptions,
    ) -> impl Iterator<Item = Self> {
        let mut held = model.clone();
        if let Some(added) = held.mechanisms.last_mut() {
            added.parameters = values.iter().copied().map(ParameterSpec::fixed).collect();
        }
        starting_values(&held).take(2).map(move |starting_values| {
            self.screening_fit(observations, &held, &starting_values).extended_by(
                observations,
                model,
                options,
            )
        })
    }

    /// `model` a short way down from a starting_values.
    fn screening_fit(
        &self,
        observations: &Observations,
        model: &Model,
        starting_values: &StartingValues,
    ) -> Self {
        let parameterisation = Parameterisation::new(observations, model, starting_values);
        let start = parameterisation.start();
        self.descended(observations, model, parameterisation, &start, GLANCE)
    }

    /// The values of the last mechanism.
    pub fn added(&self) -> &[f64] {
        let own = self.kinds.last().map_or(0, |kind| kind.parameter_count());
        &self.parameters[0][self.parameters[0].len() - own..]
    }

    /// The better of this fit and the ones from where all yields lie restart_point at once. What they shrinkage_target on would hold them.
    fn with_trials_restarted(mut self, observations: &Observations) -> Self {
        self.restart_all_trials(observations);
        self.update_parameters();
        self
    }

    /// The optimum after a second look, with the yields of single trials with_shrinkage on those of all: what a diagnosis compares,
    /// since a yield that one trial's data leave open would hide or feign a misfit of the model.
    pub fn refined(mut self, observations: &Observations) -> Self {
        self.search_multistart(observations);
        self.with_shrinkage(observations)
    }
}

/// Trials that stand for all: some of each condition.
struct TrialSubset {
    trials: Vec<usize>,
    /// For each trial of the session the place of the one that stands for it.
    stands_for: Vec<usize>,
}

impl TrialSubset {
    fn of(observations: &Observations) -> Self {
        let conditions = groups(observations, Scope::Condition);
        let of_each = GLANCED_AT.div_ceil(conditions.len().max(1));
        let mut some = Self { trials: Vec::new(), stands_for: vec![0; observations.trials.len()] };
        for alike in &conditions {
            let first = some.trials.len();
            some.trials.extend(alike.iter().take(of_each));
            for (place, trial) in alike.iter().enumerate() {
                some.stands_for[*trial] = first + place % of_each;
            }
        }
        some
    }
}
