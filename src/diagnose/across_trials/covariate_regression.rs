//! How the trials' stiffnesses go with the place in the session, the rest before, and the EMG.

use super::stiffness_table::{LEAST_STIFFNESS, Stiffnesses};
use crate::diagnose::applicability::missing;
use crate::fit::{Fit, K_SRS, Observations};
use crate::number::{Jet, Number};
use crate::random::Stream;
use crate::statistics::{gumbel_tail, slope_through_origin};
use crate::wrist::Plant;
use crate::wrist::mechanisms::{CATALOGUE, EvidenceSource, MechanismKind, MechanismParameter, ProbeContext};

/// What a mechanism explains of the stiffnesses.
#[derive(Debug, Clone)]
pub struct Trend {
    /// Which.
    pub kind: MechanismKind,
    /// Its values, and the standard errors of those that were estimated.
    pub values: Vec<(f64, Option<f64>)>,
    /// The first value's ratio to its standard error.
    pub t: f64,
    /// Root mean square of what is left, over that without the mechanism, leaving out each trial in turn.
    pub left_out_ratio: f64,
}

/// The mechanisms that act on k_srs from trial to trial, with what a change of each value does to its logarithm.
fn candidates(prepared: &Observations, fit: &Fit) -> Vec<(MechanismKind, Vec<Vec<f64>>)> {
    let session = ProbeContext { lever: prepared.lever, highest_torque_nm: 0.0 };
    CATALOGUE
        .iter()
        .copied()
        .filter(|kind| kind.evidence() == EvidenceSource::AcrossTrials)
        .filter(|kind| !fit.kinds.contains(kind) && missing(prepared, *kind).is_none())
        .map(|kind| (kind, kind.probes(&session)))
        .filter(|(kind, probes)| probes.iter().any(|values| acts_on_stiffness(prepared, fit, *kind, values)))
        .collect()
}

/// The logarithm of the stiffness that a mechanism makes of `stiffness` in a trial, and its derivatives by the logarithm of
/// that stiffness and by the mechanism's first value.
fn shaped(
    prepared: &Observations,
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
    base[K_SRS] = Jet::variable(stiffness, BASE);
    let mut plant = Plant::base(prepared.lever, &base);
    let jets: Vec<Jet<f64, 9>> =
        values.iter().enumerate().map(|(i, value)| Jet::variable(*value, i)).collect();
    kind.alter_plant(&jets, &mut plant, &prepared.trials[trial].input.covariates);
    let shaped = plant.short_range_stiffness;
    let value = shaped.value.max(LEAST_STIFFNESS);
    [libm::log(value), shaped.slope[BASE] * stiffness / value, shaped.slope[0] / value]
}

/// Place of the unshaped stiffness among the derivatives; the mechanism's values come first.
const BASE: usize = 8;

fn acts_on_stiffness(prepared: &Observations, fit: &Fit, kind: MechanismKind, values: &[f64]) -> bool {
    (0..prepared.trials.len()).any(|trial| {
        let stiffness = fit.parameters[trial][K_SRS].max(LEAST_STIFFNESS);
        (shaped(prepared, fit, trial, kind, values, stiffness)[0] - libm::log(stiffness)).abs() > 1e-9
    })
}

/// A trial's stiffness with the effect of a mechanism on it taken away.
///
/// The mechanisms of the catalogue add to a stiffness or multiply it, so one step of Newton's is exact.
pub fn without_effect(
    prepared: &Observations,
    fit: &Fit,
    trial: usize,
    kind: MechanismKind,
    values: &[f64],
) -> f64 {
    let stiffness = fit.parameters[trial][K_SRS];
    let [logarithm, weight, _] = shaped(prepared, fit, trial, kind, values, stiffness);
    let shaped = libm::exp(logarithm);
    stiffness + (stiffness - shaped) / (weight * shaped / stiffness)
}

/// The trend of one mechanism, by Gauss-Newton from a probe: one stiffness for each condition, which the mechanism makes another in
/// each of its trials.
fn trend(
    prepared: &Observations,
    fit: &Fit,
    data: &Stiffnesses,
    logarithms: &[f64],
    kind: MechanismKind,
    probe: &[f64],
) -> Option<Trend> {
    // Only the first value is estimated here; others (a time constant) are tried at the probes.
    let first: &MechanismParameter = kind.parameters().first()?;
    let absent = first.absent.unwrap_or(0.0);
    let mut values = probe.to_vec();
    values[0] = absent;
    let mut levels = data.levels(&vec![1.0; logarithms.len()], logarithms);
    let linear = |values: &[f64], levels: &[f64]| {
        let shaped =
            |(trial, level): (&usize, &f64)| shaped(prepared, fit, *trial, kind, values, libm::exp(*level));
        Linear::new(data, logarithms, &data.trials.iter().zip(levels).map(shaped).collect::<Vec<_>>())
    };
    let mut about = linear(&values, &levels)?;
    for _ in 0..STEPS {
        let before = values[0];
        values[0] = (before + about.step()).clamp(first.low, first.high);
        let step = values[0] - before;
        for (place, level) in levels.iter_mut().enumerate() {
            *level += (about.rises[place] - step * about.turns[place]).clamp(-LONGEST_RISE, LONGEST_RISE);
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
    Some(Trend { kind, values: result, t: (values[0] - absent) / se, left_out_ratio })
}

/// Most steps of a trend's fit, and how far a condition's stiffness may go in one, as a logarithm.
const STEPS: usize = 12;
const LONGEST_RISE: f64 = 0.5;

/// A trend about one place.
struct Linear {
    /// How each trial's logarithm goes with that of its condition's stiffness.
    weights: Vec<f64>,
    /// What is left of the logarithms once the conditions' stiffnesses are free, and how far these then rise.
    left: Vec<f64>,
    rises: Vec<f64>,
    /// How the logarithms go with the mechanism's value once these are free, and how far they then fall.
    slopes: Vec<f64>,
    turns: Vec<f64>,
}

impl Linear {
    /// `shaped` as [`shaped`] tells; `None` if the mechanism's value makes no difference.
    fn new(data: &Stiffnesses, logarithms: &[f64], shaped: &[[f64; 3]]) -> Option<Self> {
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

    /// How far the mechanism's value should go.
    fn step(&self) -> f64 {
        slope_through_origin(self.slopes.iter().copied().zip(self.left.iter().copied()))
    }

    /// Leaving out each trial in turn: its deviation from the other repetitions, with the trend of all others and without.
    fn left_out_ratio(&self, data: &Stiffnesses, logarithms: &[f64]) -> f64 {
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

/// How many times the trials are shuffled among the repetitions of their conditions.
const SHUFFLES: usize = 400;

/// The strongest trend, and how probable one as strong is where trials of a condition are exchangeable.
pub fn strongest_trend(
    prepared: &Observations,
    fit: &Fit,
    data: &Stiffnesses,
    seed: u64,
) -> Option<(Vec<Trend>, f64)> {
    let candidates = candidates(prepared, fit);
    let all = |logarithms: &[f64]| -> Vec<Trend> {
        let mut trends: Vec<Trend> = candidates
            .iter()
            .filter_map(|(kind, probes)| {
                let own =
                    probes.iter().filter_map(|probe| trend(prepared, fit, data, logarithms, *kind, probe));
                own.max_by(|a, b| a.t.abs().total_cmp(&b.t.abs()))
            })
            .collect();
        trends.sort_by(|a, b| b.t.abs().total_cmp(&a.t.abs()));
        trends
    };
    let observed = all(&data.logarithms);
    let strongest = observed.first()?.t.abs();
    let centred = data.centred(&data.logarithms);
    let means: Vec<f64> = data.logarithms.iter().zip(&centred).map(|(y, e)| y - e).collect();
    let mut stream = Stream::new(seed, "shuffle trials");
    let mut maxima = Vec::with_capacity(SHUFFLES);
    for _ in 0..SHUFFLES {
        let shuffled = shuffled_within(data, &centred, &mut stream);
        let logarithms: Vec<f64> = means.iter().zip(&shuffled).map(|(m, e)| m + e).collect();
        maxima.push(all(&logarithms).first().map_or(0.0, |trend| trend.t.abs()));
    }
    Some((observed, gumbel_tail(&maxima, strongest)))
}

/// The deviations handed out anew among all trials: under the hypothesis they are exchangeable, once those of conditions
/// with the same number of repetitions are on one scale.
fn shuffled_within(data: &Stiffnesses, centred: &[f64], stream: &mut Stream) -> Vec<f64> {
    let mut order: Vec<usize> = (0..data.trials.len()).collect();
    stream.shuffle(&mut order);
    order.iter().map(|place| centred[*place]).collect()
}
