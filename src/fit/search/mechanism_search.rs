//! Mechanism search: starting values for a fit that adds a mechanism, found in stages on a subset of the trials.
//!
//! First many starts are screened with few iterations on the subset. The best are completed on all trials.

use super::starting_value_search::StartingValueSearch;
use crate::fit::data::observations::Observations;
use crate::fit::fitted::fit::Fit;
use crate::fit::model::specification::{Model, ParameterSpec, Scope};
use crate::fit::parameters::parameterisation::{Parameterisation, trial_groups};
use crate::fit::parameters::starting_values::StartingValues;
use crate::fit::residuals::objective::Weighting;
use crate::fit::solver::options::SolverOptions;

/// Options of a screening fit: which start leads to the lowest cost shows long before the end.
const SCREENING: SolverOptions = SolverOptions { max_iterations: 15, tolerance: 2e-3, max_log_step: 0.7 };

/// A screened start is continued if its cost exceeds the lowest cost by less than this fraction.
const SCREENING_TOLERANCE: f64 = 0.25;

/// Options of the continuation, after which the costs can be compared.
const CONTINUATION: SolverOptions = SolverOptions { max_iterations: 40, tolerance: 2e-4, max_log_step: 0.7 };

/// A continued start is completed on all trials if its cost exceeds the lowest cost by less than this.
const COST_WINDOW: f64 = 25.0;

/// Largest number of starts that are completed on all trials.
const MAX_COMPLETED: usize = 5;

/// Relative difference of the mechanism's parameters below which two starts count as the same.
const SAME_PARAMETERS: f64 = 0.02;

/// Approximate number of trials in the subset.
const SUBSET_SIZE: usize = 12;

/// Search for the optimum of models that add a mechanism to a fit.
pub struct MechanismSearch<'a> {
    observations: &'a Observations,
    starting_values: StartingValueSearch,
    subset: TrialSubset,
    /// The observations of the subset.
    few: Observations,
    /// The fit without the mechanism, restricted to the subset.
    base: Fit,
    /// Cost of the fit without the mechanism on the subset.
    base_cost: f64,
}

/// A model that adds a mechanism, after short fits to the subset.
pub struct StartedMechanism {
    /// Those whose continuation may be the best one, the best first.
    starts: Vec<Fit>,
    /// Decrease of the sum of squared residuals of the whole session that they predict, in units of the noise variance.
    pub gain: f64,
    /// The same if their continuation decreases the cost by as much as the screening allows for.
    pub possible_gain: f64,
}

/// A model that adds a mechanism, after the screening on the subset.
pub struct ScreenedMechanism {
    /// Fits to the subset from several starts, the best first.
    starts: Vec<Fit>,
    /// Predicted decrease of the sum of squared residuals of the whole session, in units of the noise variance.
    pub predicted_gain: f64,
}

impl<'a> MechanismSearch<'a> {
    /// A search for added mechanisms of `fit`.
    pub fn new(observations: &'a Observations, fit: &'a Fit) -> Self {
        let starting_values = StartingValueSearch::new(observations, Weighting::MeasuredNoise);
        let subset = TrialSubset::of(observations);
        let few = observations.subset(&subset.trials);
        let (base, base_cost) = on_subset(fit, &subset, &few, SCREENING);
        Self { observations, starting_values, subset, few, base, base_cost }
    }

    /// Screens the starts of `models`, which differ only in the starting values of the mechanism.
    ///
    /// # Panics
    /// If `models` is empty.
    pub fn screen(&self, models: &[Model]) -> ScreenedMechanism {
        self.continued(self.start(models))
    }

    /// The first part of [`MechanismSearch::screen`], short fits.
    ///
    /// # Panics
    /// If `models` is empty.
    pub fn start(&self, models: &[Model]) -> StartedMechanism {
        let mut starts: Vec<Fit> = models.iter().flat_map(|model| self.screening_fits(model)).collect();
        sort_by_cost(&mut starts);
        let lowest = starts[0].cost();
        starts.retain(|fit| fit.cost() <= lowest * (1.0 + SCREENING_TOLERANCE));
        let possible_gain = self.gain_at(lowest / (1.0 + SCREENING_TOLERANCE));
        StartedMechanism { starts, gain: self.gain_at(lowest), possible_gain }
    }

    /// The second part of [`MechanismSearch::screen`], which continues the short fits until their costs can be compared.
    pub fn continued(&self, started: StartedMechanism) -> ScreenedMechanism {
        let StartedMechanism { mut starts, .. } = started;
        starts.iter_mut().for_each(|fit| *fit = fit.extended_by(&self.few, &fit.model, CONTINUATION));
        sort_by_cost(&mut starts);
        starts.insert(0, self.with_components_restarted(starts[0].clone()));
        ScreenedMechanism { predicted_gain: self.gain_at(starts[0].cost()), starts }
    }

    /// Predicted decrease of the sum of squared residuals of the whole session, in units of the noise variance, by a model that has this
    /// cost on the subset.
    fn gain_at(&self, cost: f64) -> f64 {
        let share = self.subset.trials.len() as f64 / self.observations.trials.len() as f64;
        2.0 * (self.base_cost - cost) / share
    }

    /// Completes the best starts of `screened` on all trials and returns the best fit, with shrinkage. Other optima along x_e are
    /// searched only by [`Fit::refined`].
    pub fn complete(&self, screened: &ScreenedMechanism) -> Fit {
        let highest = screened.starts[0].cost() + COST_WINDOW;
        let mut distinct: Vec<&Fit> = Vec::new();
        for own in screened.starts.iter().take_while(|own| own.cost() <= highest) {
            if distinct.len() < MAX_COMPLETED && !distinct.iter().any(|other| is_same(own, other)) {
                distinct.push(own);
            }
        }
        let completed = distinct.into_iter().map(|own| self.on_all_trials(own));
        let best = completed.reduce(|best, own| if own.cost() < best.cost() { own } else { best });
        best.expect("at least one model was screened").with_shrinkage(self.observations)
    }

    /// Screening fits of `model` to the subset: from starting values of its own, since the optimum without the mechanism may be far
    /// away; and from that optimum, since the effect of the mechanism may be small.
    ///
    /// From its own starting values, all parameters are first free together, then the mechanism is released in a second stage.
    fn screening_fits(&self, model: &Model) -> Vec<Fit> {
        let last = model.mechanisms.last().into_iter();
        let specs = last.flat_map(|added| added.parameters.iter().zip(added.kind.parameters()));
        let first: Vec<f64> =
            specs.map(|(spec, parameter)| spec.value.unwrap_or(parameter.typical)).collect();
        let free = self.own_starting_values(model).take(1).map(|values| self.screening_fit(model, &values));
        let staged = self.staged_fits(model, &first);
        let warm = std::iter::once_with(|| self.base.extended_by(&self.few, model, SCREENING));
        free.chain(staged).chain(warm).collect()
    }

    /// Fits of `model` to the subset in two stages: first the last mechanism is held at `values` while the other parameters adapt,
    /// then all parameters are free. Free from the beginning, the mechanism would compensate for wrong values of x_e.
    fn staged_fits<'b>(
        &'b self,
        model: &'b Model,
        values: &[f64],
    ) -> impl Iterator<Item = Fit> + use<'a, 'b> {
        let mut held = model.clone();
        if let Some(last) = held.mechanisms.last_mut() {
            last.parameters = values.iter().copied().map(ParameterSpec::fixed).collect();
        }
        let starts: Vec<StartingValues> = self.own_starting_values(&held).take(2).collect();
        starts
            .into_iter()
            .map(move |values| self.screening_fit(&held, &values).extended_by(&self.few, model, SCREENING))
    }

    /// Fits `model` to the subset from `starting_values`, with the options of the screening.
    fn screening_fit(&self, model: &Model, starting_values: &StartingValues) -> Fit {
        let parameterisation = Parameterisation::new(&self.few, model, starting_values);
        let start = parameterisation.start();
        self.base.optimised_from(&self.few, model, parameterisation, &start, SCREENING)
    }

    /// Starting values of the trials of the subset from the search for starting values of `model`, the best first.
    fn own_starting_values(&self, model: &Model) -> impl Iterator<Item = StartingValues> + use<'_, 'a> {
        let all = self.starting_values.starting_values(self.observations, model).into_iter();
        all.map(|values| values.subset(&self.subset.trials))
    }

    /// A fit to the subset after a restart of its components.
    fn with_components_restarted(&self, mut fit: Fit) -> Fit {
        fit.restart_components(&self.few);
        fit.update_parameters();
        fit
    }

    /// Continues a fit to the subset on all trials: each trial starts at the optimum of its representative.
    fn on_all_trials(&self, fit: &Fit) -> Fit {
        let parameters = self.subset.representative.iter().map(|own| fit.parameters[*own].clone()).collect();
        Fit { parameters, ..fit.clone() }.extended(self.observations, &fit.model)
    }
}

impl Fit {
    /// This fit after a multistart search and with shrinkage. A diagnosis compares such fits: an x_e that the data of one trial leave
    /// open would hide a misfit of the model, or imitate one.
    pub fn refined(mut self, observations: &Observations) -> Self {
        self.search_multistart(observations);
        self.with_shrinkage(observations)
    }
}

/// A fit restricted to a subset, without shrinkage, and its cost after `options` on the subset.
fn on_subset(fit: &Fit, subset: &TrialSubset, few: &Observations, options: SolverOptions) -> (Fit, f64) {
    let restricted = Fit { shrinkage_target: None, ..fit.restricted_to(&subset.trials) };
    let cost = restricted.extended_by(few, &fit.model, options).cost();
    (restricted, cost)
}

fn sort_by_cost(fits: &mut [Fit]) {
    fits.sort_by(|a, b| a.cost().total_cmp(&b.cost()));
}

/// Whether two fits ended at the same parameters of the mechanism.
fn is_same(one: &Fit, other: &Fit) -> bool {
    let near = |(a, b): (&f64, &f64)| (a - b).abs() <= SAME_PARAMETERS * a.abs().max(b.abs());
    one.last_mechanism_parameters().iter().zip(other.last_mechanism_parameters()).all(near)
}

/// A subset of the trials with some of each condition.
struct TrialSubset {
    /// Indices of the trials.
    trials: Vec<usize>,
    /// For each trial of the session, the position in `trials` of a trial of the same condition.
    representative: Vec<usize>,
}

impl TrialSubset {
    fn of(observations: &Observations) -> Self {
        let conditions = trial_groups(observations, Scope::Condition);
        let per_condition = SUBSET_SIZE.div_ceil(conditions.len().max(1));
        let mut subset = Self { trials: Vec::new(), representative: vec![0; observations.trials.len()] };
        for condition in &conditions {
            let first = subset.trials.len();
            subset.trials.extend(condition.iter().take(per_condition));
            for (position, trial) in condition.iter().enumerate() {
                subset.representative[*trial] = first + position % per_condition;
            }
        }
        subset
    }
}
