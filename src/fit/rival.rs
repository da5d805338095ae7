//! A mechanism added to a fit: of many starts a few trials tell which leads furthest down, and all trials where it ends.

use super::first_look::FirstLook;
use super::guess::Guess;
use super::layout::{Layout, groups};
use super::model::{Model, Scope, Treatment};
use super::prepare::Prepared;
use super::run::Fit;
use super::solve::Effort;

/// Which of several starts leads furthest down shows long before its end; those stay that are behind by less than this part of
/// the cost.
const GLANCE: Effort = Effort { iterations: 15, decrease: 2e-3, longest_step: 0.7 };
const GLANCE_ERROR: f64 = 0.25;

/// About how many trials a glance needs.
const GLANCED_AT: usize = 12;

impl Fit {
    /// Fits a model that adds a mechanism to this fit's, with this fit's weights. `models` are the same but for the values that
    /// the mechanism starts from. Looks for other optima only on the way to [`Fit::settled`].
    ///
    /// # Panics
    /// If there are no models.
    pub fn rival(&self, prepared: &Prepared, first: &FirstLook, models: &[Model]) -> Self {
        let some = Sample::of(prepared);
        let few = prepared.only(&some.trials);
        let here = Self { lean: None, ..self.of(&some.trials) };
        let guesses =
            |model: &Model| first.guesses(prepared, model).into_iter().map(|guess| guess.only(&some.trials));
        let mut starts: Vec<Self> =
            models.iter().flat_map(|model| here.glances(&few, model, guesses)).collect();
        starts.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
        let within = starts[0].cost() * (1.0 + GLANCE_ERROR);
        let to_the_end = |fit: &Self| {
            let parameters = some.stands_for.iter().map(|own| fit.parameters[*own].clone()).collect();
            Self { parameters, ..fit.clone() }.extended(prepared, &fit.model)
        };
        let ends = starts.iter().take_while(|fit| fit.cost() <= within).map(to_the_end);
        let best = ends.reduce(|best, own| if own.cost() < best.cost() { own } else { best });
        best.expect("at least one model").leaning(prepared).regrouped(prepared)
    }

    /// `model` a short way down from several starts: from first guesses of its own, since where this fit ended may be far off
    /// if it lacks what the model has, and from there, since what it lacks may be small.
    ///
    /// Once all parameters start together, and once those of the mechanism are held until the others have come to terms
    /// with them: free from the beginning they run off to make up for yields that are in the wrong place.
    fn glances<G: Iterator<Item = Guess>>(
        &self,
        prepared: &Prepared,
        model: &Model,
        guesses: impl Fn(&Model) -> G,
    ) -> Vec<Self> {
        let from = |model: &Model, guess: &Guess| {
            let layout = Layout::new(prepared, model, guess);
            let start = layout.start();
            self.descended(prepared, model, layout, &start, GLANCE)
        };
        let mut held = model.clone();
        if let Some(added) = held.mechanisms.last_mut() {
            for (treatment, parameter) in added.parameters.iter_mut().zip(added.kind.parameters()) {
                *treatment = Treatment::fixed(treatment.value.unwrap_or(parameter.typical));
            }
        }
        let free = guesses(model).take(1).map(|guess| from(model, &guess));
        let released =
            guesses(&held).take(2).map(|guess| from(&held, &guess).extended_by(prepared, model, GLANCE));
        free.chain(released)
            .chain(std::iter::once_with(|| self.extended_by(prepared, model, GLANCE)))
            .collect()
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

    /// The optimum after a second look, with the yields of single trials leaning on those of all: what a diagnosis compares,
    /// since a yield that one trial's data leave open would hide or feign a misfit of the model.
    pub fn settled(mut self, prepared: &Prepared) -> Self {
        self.look_again(prepared);
        self.leaning(prepared)
    }
}

/// Trials that stand for all: some of each condition.
struct Sample {
    trials: Vec<usize>,
    /// For each trial of the session the place of the one that stands for it.
    stands_for: Vec<usize>,
}

impl Sample {
    fn of(prepared: &Prepared) -> Self {
        let conditions = groups(prepared, Scope::Condition);
        let of_each = GLANCED_AT.div_ceil(conditions.len().max(1));
        let mut some = Self { trials: Vec::new(), stands_for: vec![0; prepared.trials.len()] };
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
