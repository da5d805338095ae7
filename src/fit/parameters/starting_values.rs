//! Starting values of the parameters, and the bounds about them.

use super::coordinate::BoundedStart;
use crate::fit::data::observations::Observations;
use crate::fit::model::specification::{Model, ParameterSpec};
use crate::statistics::upper_median;
use crate::wrist::{BASE_PARAMETERS, Lever};

/// Bounds of the elastic limit x_e, as fractions of the largest motor angle in the window.
const MIN_X_E_FRACTION: f64 = 0.08;
const MAX_X_E_FRACTION: f64 = 1.05;

/// Bounds of the base parameters before x_e: the starting value divided by the first factor and multiplied by the second.
pub(in crate::fit) const BOUND_FACTORS: [(f64, f64); 5] =
    [(8.0, 8.0), (30.0, 10.0), (8.0, 12.0), (5.0, 5.0), (20.0, 8.0)];

/// By how much, as a part of it, a value at a bound may be off it after a logarithm and back.
const BOUND_ROUNDING: f64 = 1e-9;

/// Base parameters of a trial if the search finds no starting values.
const DEFAULT_PARAMETERS: [f64; 6] = [1e-3, 1.0, 100.0, 10.0, 5.0, 0.01];

/// Starting values of each trial's base parameters and of the parameters of mechanisms.
#[derive(Debug, Clone)]
pub struct StartingValues {
    /// Base parameters of each trial.
    trials: Vec<[f64; 6]>,
    /// Parameters of the mechanisms, if they were part of the search for starting values; otherwise empty.
    mechanisms: Vec<f64>,
    /// Largest motor angle in the window of each trial, rad.
    peak_angle_rad: Vec<f64>,
    /// The values are those of a fit, and the bounds contain them.
    are_of_fit: bool,
    lever: Option<Lever>,
}

impl StartingValues {
    /// Starting values that the caller knows: the six base parameters of each trial.
    ///
    /// # Panics
    /// If `trials` does not have one entry per trial.
    pub fn new(observations: &Observations, trials: Vec<[f64; 6]>) -> Self {
        Self::with_mechanisms(observations, trials, Vec::new())
    }

    /// Starting values of base parameters, trial by trial, and of the parameters of mechanisms.
    ///
    /// # Panics
    /// If `trials` does not have one entry per trial.
    pub(in crate::fit) fn with_mechanisms(
        observations: &Observations,
        trials: Vec<[f64; 6]>,
        mechanisms: Vec<f64>,
    ) -> Self {
        assert_eq!(trials.len(), observations.trials.len(), "one set of starting values per trial");
        let peak_angle_rad =
            (0..observations.trials.len()).map(|trial| observations.peak_angle_rad(trial)).collect();
        Self { trials, mechanisms, peak_angle_rad, are_of_fit: false, lever: observations.lever }
    }

    /// Starting values from the parameter vectors of a fit, within the bounds wherever they are: a fit by priors has no bounds of x_e.
    /// Those of mechanisms come from the model.
    pub fn from_parameters(observations: &Observations, parameters: &[Vec<f64>]) -> Self {
        let base = |values: &Vec<f64>| {
            let mut base = [0.0; 6];
            base.copy_from_slice(&values[..BASE_PARAMETERS.len()]);
            base
        };
        Self { are_of_fit: true, ..Self::new(observations, parameters.iter().map(base).collect()) }
    }

    /// Starting values if the search finds none: the same for all trials.
    pub(in crate::fit) fn default_for(observations: &Observations) -> Self {
        Self::new(observations, vec![DEFAULT_PARAMETERS; observations.trials.len()])
    }

    /// Starting value of a base parameter of a trial.
    pub fn value(&self, trial: usize, parameter: usize) -> f64 {
        self.trials[trial][parameter]
    }

    /// Median of each base parameter over the trials.
    pub fn median_values(&self) -> [f64; 6] {
        std::array::from_fn(|parameter| {
            upper_median(self.trials.iter().map(|own| own[parameter])).unwrap_or(f64::NAN)
        })
    }

    /// Starting values of `trials`, given by index.
    pub fn subset(&self, trials: &[usize]) -> Self {
        Self {
            trials: trials.iter().map(|trial| self.trials[*trial]).collect(),
            mechanisms: self.mechanisms.clone(),
            are_of_fit: self.are_of_fit,
            peak_angle_rad: trials.iter().map(|trial| self.peak_angle_rad[*trial]).collect(),
            lever: self.lever,
        }
    }

    /// Bounds and starting value of a parameter that the trials `members` share.
    pub(in crate::fit) fn bounds(
        &self,
        model: &Model,
        parameter: usize,
        spec: &ParameterSpec,
        members: &[usize],
    ) -> BoundedStart {
        let of_mechanism = parameter.checked_sub(BASE_PARAMETERS.len());
        let mut bounds = match of_mechanism {
            None => self.base_bounds(parameter, members),
            Some(added) => self.mechanism_bounds(model, added),
        };
        // A bound of the model alone, beyond what is usual, takes the other one away.
        match (spec.low, spec.high) {
            (Some(low), None) if low >= bounds.high => bounds.high = f64::INFINITY,
            (None, Some(high)) if high <= bounds.low => {
                bounds.low = if bounds.low > 0.0 { f64::MIN_POSITIVE } else { f64::NEG_INFINITY };
            }
            _ => {}
        }
        bounds.low = spec.low.unwrap_or(bounds.low);
        bounds.high = spec.high.unwrap_or(bounds.high);
        let found = of_mechanism.and_then(|added| self.mechanisms.get(added));
        bounds.start = found.copied().or(spec.value).unwrap_or(bounds.start);
        if spec.law.is_empty() {
            bounds.start = bounds.start.clamp(bounds.low, bounds.high);
        }
        bounds
    }

    /// Bounds of a base parameter about the geometric mean over the trials `members`.
    fn base_bounds(&self, parameter: usize, members: &[usize]) -> BoundedStart {
        let geometric_mean = |value: &dyn Fn(usize) -> f64| {
            libm::exp(members.iter().map(|t| libm::log(value(*t))).sum::<f64>() / members.len() as f64)
        };
        let start = geometric_mean(&|trial| self.trials[trial][parameter]);
        match BOUND_FACTORS.get(parameter) {
            Some((below, above)) => BoundedStart { low: start / below, high: start * above, start },
            None => {
                let (mut low, mut high) = x_e_bounds(geometric_mean(&|trial| self.peak_angle_rad[trial]));
                let is_beyond = start < low * (1.0 - BOUND_ROUNDING) || start > high * (1.0 + BOUND_ROUNDING);
                if self.are_of_fit && is_beyond {
                    let (lower, higher) = x_e_bounds(start);
                    (low, high) = (low.min(lower), high.max(higher));
                }
                BoundedStart { low, high, start }
            }
        }
    }

    /// Bounds of the parameter number `added` among the parameters of mechanisms.
    fn mechanism_bounds(&self, model: &Model, mut added: usize) -> BoundedStart {
        for mechanism in &model.mechanisms {
            if let Some(parameter) = mechanism.kind.parameters().get(added) {
                return BoundedStart {
                    low: parameter.low,
                    high: parameter.high,
                    start: mechanism.kind.starting_value(added, self.lever),
                };
            }
            added -= mechanism.kind.parameter_count();
        }
        unreachable!("a model has as many parameters as its mechanisms say")
    }
}

/// Bounds of x_e, rad, for a largest motor angle in the window, rad.
pub(in crate::fit) fn x_e_bounds(peak_angle_rad: f64) -> (f64, f64) {
    (MIN_X_E_FRACTION * peak_angle_rad, MAX_X_E_FRACTION * peak_angle_rad)
}
