//! Regression of the trials' stiffnesses on a covariate (position in the session, rest before the trial, EMG): what it gains on trials
//! left out.

use super::stiffness_table::{MIN_STIFFNESS_NM_PER_RAD, StiffnessTable};
use crate::fit::{Fit, K_SRS, Observations, mechanism_ranges};
use crate::number::{Jet, Number};
use crate::statistics::slope_through_origin;
use crate::wrist::mechanisms::{MechanismKind, MechanismParameter, ProbeContext};
use crate::wrist::{BASE_PARAMETERS, Plant};

/// Effect of a mechanism's covariate on the stiffnesses.
#[derive(Debug, Clone)]
pub struct CovariateEffect {
    /// The mechanism.
    pub kind: MechanismKind,
    /// Values of the mechanism's parameters, with standard errors of the estimated ones.
    pub values: Vec<(f64, Option<f64>)>,
    /// Ratio of the first value, less its value without effect, to the standard error.
    pub t: f64,
    /// Leave-one-out root-mean-square deviation with the mechanism relative to that without.
    pub left_out_ratio: f64,
}

/// Logarithm of the stiffness of a trial after a mechanism has acted on `stiffness`, and its derivatives with respect to the logarithm
/// of `stiffness` and to the mechanism's first parameter.
fn shaped(
    observations: &Observations,
    fit: &Fit,
    trial: usize,
    kind: MechanismKind,
    values: &[f64],
    stiffness: f64,
) -> [f64; 3] {
    let mut base = [Jet::<f64, 9>::constant(1.0); 6];
    for (slot, value) in base.iter_mut().zip(&fit.parameters[trial]) {
        *slot = Jet::constant(*value);
    }
    base[K_SRS] = Jet::variable(stiffness, STIFFNESS_DERIVATIVE);
    let mut plant = Plant::base(observations.lever, &base);
    let jets: Vec<Jet<f64, 9>> =
        values.iter().enumerate().map(|(i, value)| Jet::variable(*value, i)).collect();
    kind.alter_plant(&jets, &mut plant, &observations.trials[trial].input.covariates);
    let shaped = plant.short_range_stiffness;
    let value = shaped.value.max(MIN_STIFFNESS_NM_PER_RAD);
    [libm::log(value), shaped.slope[STIFFNESS_DERIVATIVE] * stiffness / value, shaped.slope[0] / value]
}

/// Index of the unaltered stiffness among the derivatives; the mechanism's parameters come first.
const STIFFNESS_DERIVATIVE: usize = 8;

/// Stiffness of a trial with the effect of a mechanism removed, N m/rad.
pub fn without_effect(
    observations: &Observations,
    fit: &Fit,
    trial: usize,
    kind: MechanismKind,
    values: &[f64],
) -> f64 {
    freed(observations, fit, trial, (kind, values), fit.parameters[trial][K_SRS])
}

/// `fit` with the mechanism `kind`, which acts on k_srs of single trials, in these stiffnesses instead of in the model.
pub fn with_effect_in_parameters(observations: &Observations, fit: &Fit, kind: MechanismKind) -> Fit {
    let Some(place) = fit.kinds.iter().position(|own| *own == kind) else { return fit.clone() };
    let range = mechanism_ranges(&fit.kinds)[place].clone();
    let mut changed = fit.clone();
    for (trial, own) in changed.parameters.iter_mut().enumerate() {
        let mut plant = Plant::base(observations.lever, &own[..BASE_PARAMETERS.len()]);
        kind.alter_plant(&own[range.clone()], &mut plant, &observations.trials[trial].input.covariates);
        own[K_SRS] = plant.short_range_stiffness.max(MIN_STIFFNESS_NM_PER_RAD);
    }
    changed.with_mechanism_removed(observations, kind)
}

/// `stiffness` of a trial with the effect of a mechanism removed, N m/rad.
///
/// The mechanisms of the catalogue add to a stiffness or multiply it, so that one Newton step is exact.
fn freed(
    observations: &Observations,
    fit: &Fit,
    trial: usize,
    (kind, values): (MechanismKind, &[f64]),
    stiffness: f64,
) -> f64 {
    let [logarithm, weight, _] = shaped(observations, fit, trial, kind, values, stiffness);
    let shaped = libm::exp(logarithm);
    stiffness + (stiffness - shaped) / (weight * shaped / stiffness)
}

/// Effect of one mechanism, by Gauss-Newton steps from a probe. The model is one stiffness per condition, which the mechanism alters in
/// each trial.
fn covariate_effect(
    observations: &Observations,
    fit: &Fit,
    data: &StiffnessTable,
    logarithms: &[f64],
    kind: MechanismKind,
    probe: &[f64],
) -> Option<CovariateEffect> {
    // Only the first parameter is estimated; others, such as a time constant, take the values of the probes.
    let first: &MechanismParameter = kind.parameters().first()?;
    let absent = first.absent.unwrap_or(0.0);
    let mut values = probe.to_vec();
    values[0] = absent;
    let mut levels = data.levels(&vec![1.0; logarithms.len()], logarithms);
    let linear = |values: &[f64], levels: &[f64]| {
        let shaped = |(trial, level): (&usize, &f64)| {
            shaped(observations, fit, *trial, kind, values, libm::exp(*level))
        };
        LinearisedRegression::new(
            data,
            logarithms,
            &data.trials.iter().zip(levels).map(shaped).collect::<Vec<_>>(),
        )
    };
    let mut about = linear(&values, &levels)?;
    for _ in 0..MAX_GAUSS_NEWTON_STEPS {
        let before = values[0];
        values[0] = (before + about.step()).clamp(first.low, first.high);
        let step = values[0] - before;
        for (place, level) in levels.iter_mut().enumerate() {
            *level += (about.rises[place] - step * about.turns[place]).clamp(-MAX_LEVEL_STEP, MAX_LEVEL_STEP);
        }
        about = linear(&values, &levels)?;
        if step.abs() < 1e-6 * values[0].abs().max(1e-6) {
            break;
        }
    }
    let variance = squares(&about.left) / (data.freedom() - 1.0);
    let se = libm::sqrt(variance / squares(&about.slopes));
    let mut result: Vec<(f64, Option<f64>)> = values.iter().map(|value| (*value, None)).collect();
    result[0].1 = Some(se);
    let left_out_ratio = about.left_out_ratio(data, logarithms);
    Some(CovariateEffect { kind, values: result, t: (values[0] - absent) / se, left_out_ratio })
}

/// Largest number of Gauss-Newton steps.
const MAX_GAUSS_NEWTON_STEPS: usize = 12;
/// Largest change of the logarithm of a condition's stiffness in one Gauss-Newton step.
const MAX_LEVEL_STEP: f64 = 0.5;

/// The regression linearised at one point.
struct LinearisedRegression {
    /// Derivative of each trial's logarithm with respect to that of its condition's stiffness.
    weights: Vec<f64>,
    /// Residuals of the logarithms after the stiffnesses of the conditions are fitted.
    left: Vec<f64>,
    /// Changes of the logarithms of the conditions' stiffnesses by that fit.
    rises: Vec<f64>,
    /// Derivatives of the logarithms with respect to the mechanism's value, after the stiffnesses of the conditions are fitted.
    slopes: Vec<f64>,
    /// Changes of the logarithms of the conditions' stiffnesses per unit of the mechanism's value.
    turns: Vec<f64>,
}

impl LinearisedRegression {
    /// `shaped` holds the results of [`shaped`]; `None` if the mechanism's value has no effect.
    fn new(data: &StiffnessTable, logarithms: &[f64], shaped: &[[f64; 3]]) -> Option<Self> {
        let weights: Vec<f64> = shaped.iter().map(|[_, weight, _]| *weight).collect();
        let without_levels = |values: Vec<f64>| {
            let levels = data.levels(&weights, &values);
            let left = |place: usize| values[place] - weights[place] * levels[place];
            ((0..values.len()).map(left).collect::<Vec<f64>>(), levels)
        };
        let (left, rises) =
            without_levels(logarithms.iter().zip(shaped).map(|(own, [value, ..])| own - value).collect());
        let (slopes, turns) = without_levels(shaped.iter().map(|[.., slope]| *slope).collect());
        (squares(&slopes) > 1e-20).then_some(Self { weights, left, rises, slopes, turns })
    }

    /// Gauss-Newton step of the mechanism's value.
    fn step(&self) -> f64 {
        slope_through_origin(self.slopes.iter().copied().zip(self.left.iter().copied()))
    }

    /// Leave-one-out root-mean-square deviation from the other repetitions, with the mechanism relative to that without.
    fn left_out_ratio(&self, data: &StiffnessTable, logarithms: &[f64]) -> f64 {
        let before = data.centred(logarithms);
        let square = squares(&self.slopes);
        let (mut with, mut without) = (0.0, 0.0);
        for (place, deviation) in before.iter().enumerate() {
            let count = data.repetitions(place).count() as f64;
            if count < 2.0 {
                continue;
            }
            let weights: f64 =
                data.repetitions(place).map(|other| self.weights[other] * self.weights[other]).sum();
            let own = self.weights[place] * self.weights[place] / weights;
            let leverage = (own + self.slopes[place] * self.slopes[place] / square).min(0.95);
            let error = self.left[place] / (1.0 - leverage);
            with += error * error;
            let error = deviation / (1.0 - 1.0 / count);
            without += error * error;
        }
        libm::sqrt(with / without.max(1e-30))
    }
}

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// The effect of `kind`, from the probe that describes the stiffnesses best; `None` if it has no effect on them.
pub fn covariate_effect_of(
    observations: &Observations,
    fit: &Fit,
    data: &StiffnessTable,
    kind: MechanismKind,
) -> Option<CovariateEffect> {
    let session = ProbeContext {
        lever: observations.lever,
        highest_torque_nm: 0.0,
        window_s: observations.samples as f64 * observations.period_s,
    };
    let probes = kind.probes(&session);
    let effects = probes
        .iter()
        .filter_map(|probe| covariate_effect(observations, fit, data, &data.logarithms, kind, probe));
    effects.max_by(|a, b| a.t.abs().total_cmp(&b.t.abs()))
}
