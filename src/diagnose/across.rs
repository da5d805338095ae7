//! Across the trials: effects that leave no trace in a trial's own residual because its parameters absorb them.
//!
//! The stiffness that each trial came out with is compared among the repetitions of its condition: does it go with the place
//! in the session, the rest, the EMG? And does any trial differ more than the spread of all allows?

use nalgebra::{DMatrix, DVector};

use super::screen::missing;
use crate::fit::{Fit, Prepared};
use crate::random::Stream;
use crate::wrist::mechanisms::{CATALOGUE, Class, Kind, Parameter, Surroundings};
use crate::wrist::{Jet, Number, Plant};

/// Index of k_srs in a trial's parameters.
const STIFFNESS: usize = 3;

/// What a mechanism explains of the stiffnesses.
#[derive(Debug, Clone)]
pub struct Trend {
    /// Which.
    pub kind: Kind,
    /// Its values, and the standard errors of those that were estimated.
    pub values: Vec<(f64, Option<f64>)>,
    /// The first value's ratio to its standard error.
    pub t: f64,
    /// Root mean square of what is left, over that without the mechanism, leaving out each trial in turn.
    pub left_out_ratio: f64,
}

/// The logarithms of the stiffnesses and the conditions of the trials that are looked at.
pub struct Stiffnesses {
    trials: Vec<usize>,
    logarithms: Vec<f64>,
    conditions: Vec<usize>,
}

/// Fewest trials in excess of the conditions that a trend can be seen on.
const FEWEST_FREE: usize = 6;

impl Stiffnesses {
    /// Those of `fit`, without the trials in `except`; `None` if there are too few repetitions.
    pub fn new(prepared: &Prepared, fit: &Fit, except: &[usize]) -> Option<Self> {
        let trials: Vec<usize> = (0..prepared.trials.len()).filter(|t| !except.contains(t)).collect();
        let conditions: Vec<usize> = trials.iter().map(|trial| prepared.trials[*trial].condition).collect();
        let mut distinct = conditions.clone();
        distinct.sort_unstable();
        distinct.dedup();
        let logarithms =
            trials.iter().map(|trial| libm::log(fit.parameters[*trial][STIFFNESS].max(1e-9))).collect();
        (trials.len() >= distinct.len() + FEWEST_FREE).then_some(Self { trials, logarithms, conditions })
    }

    /// Degrees of freedom about the conditions' means.
    fn freedom(&self) -> f64 {
        let mut distinct = self.conditions.clone();
        distinct.sort_unstable();
        distinct.dedup();
        (self.trials.len() - distinct.len()) as f64
    }

    /// Values less the mean of their condition.
    fn centred(&self, values: &[f64]) -> Vec<f64> {
        let means = self.levels(&vec![1.0; values.len()], values);
        values.iter().zip(means).map(|(value, mean)| value - mean).collect()
    }

    /// For each trial the one factor of its condition by which `weights` come nearest to `values`.
    fn levels(&self, weights: &[f64], values: &[f64]) -> Vec<f64> {
        let level = |condition: &usize| {
            let own = (0..values.len()).filter(|place| self.conditions[*place] == *condition);
            let (product, square) = own.fold((0.0, 0.0), |(product, square), place| {
                (product + weights[place] * values[place], square + weights[place] * weights[place])
            });
            product / square
        };
        self.conditions.iter().map(level).collect()
    }
}

/// The mechanisms that act on k_srs from trial to trial, with what a change of each value does to its logarithm.
fn candidates(prepared: &Prepared, fit: &Fit) -> Vec<(Kind, Vec<Vec<f64>>)> {
    let session = Surroundings { lever: prepared.lever, highest_torque_nm: 0.0 };
    CATALOGUE
        .iter()
        .copied()
        .filter(|kind| kind.class() == Class::Trial && !kind.parameters().is_empty())
        .filter(|kind| !fit.kinds.contains(kind) && missing(prepared, *kind).is_none())
        .map(|kind| (kind, kind.probes(&session)))
        .filter(|(kind, probes)| probes.iter().any(|values| acts_on_stiffness(prepared, fit, *kind, values)))
        .collect()
}

/// The logarithm of the stiffness that a mechanism makes of `stiffness` in a trial, and its derivatives by the logarithm of
/// that stiffness and by the mechanism's first value.
fn shaped(
    prepared: &Prepared,
    fit: &Fit,
    trial: usize,
    kind: Kind,
    values: &[f64],
    stiffness: f64,
) -> [f64; 3] {
    let mut base = [Jet::<f64, 9>::constant(1.0); 6];
    for (slot, value) in base.iter_mut().zip(&fit.parameters[trial]) {
        *slot = Jet::constant(*value);
    }
    base[STIFFNESS] = Jet::variable(stiffness, BASE);
    let mut plant = Plant::base(prepared.lever, &base);
    let jets: Vec<Jet<f64, 9>> =
        values.iter().enumerate().map(|(i, value)| Jet::variable(*value, i)).collect();
    kind.shape(&jets, &mut plant, &prepared.trials[trial].input.covariates);
    let shaped = plant.short_range_stiffness;
    let value = shaped.value.max(LEAST_STIFFNESS);
    [libm::log(value), shaped.slope[BASE] * stiffness / value, shaped.slope[0] / value]
}

/// Place of the unshaped stiffness among the derivatives; the mechanism's values come first.
const BASE: usize = 8;

/// Where a stiffness has a logarithm, N m/rad.
const LEAST_STIFFNESS: f64 = 1e-9;

fn acts_on_stiffness(prepared: &Prepared, fit: &Fit, kind: Kind, values: &[f64]) -> bool {
    (0..prepared.trials.len()).any(|trial| {
        let stiffness = fit.parameters[trial][STIFFNESS].max(LEAST_STIFFNESS);
        (shaped(prepared, fit, trial, kind, values, stiffness)[0] - libm::log(stiffness)).abs() > 1e-9
    })
}

/// The trend of one mechanism, by Gauss-Newton from a probe: one stiffness for each condition, which the mechanism makes another in
/// each of its trials.
fn trend(
    prepared: &Prepared,
    fit: &Fit,
    data: &Stiffnesses,
    logarithms: &[f64],
    kind: Kind,
    probe: &[f64],
) -> Option<Trend> {
    // Only the first value is estimated here; others (a time constant) are tried at the probes.
    let first: &Parameter = kind.parameters().first()?;
    let mut values = probe.to_vec();
    values[0] = first.absent.unwrap_or(0.0);
    let mut levels = data.levels(&vec![1.0; logarithms.len()], logarithms);
    let mut last = Linear { left: data.centred(logarithms), weights: Vec::new(), slopes: Vec::new() };
    for _ in 0..STEPS {
        let shaped: Vec<[f64; 3]> = (0..levels.len())
            .map(|place| shaped(prepared, fit, data.trials[place], kind, &values, libm::exp(levels[place])))
            .collect();
        let weights: Vec<f64> = shaped.iter().map(|[_, weight, _]| *weight).collect();
        let without_levels = |values: Vec<f64>| -> (Vec<f64>, Vec<f64>) {
            let levels = data.levels(&weights, &values);
            let left =
                (0..values.len()).map(|place| values[place] - weights[place] * levels[place]).collect();
            (left, levels)
        };
        let (left, rises) =
            without_levels(logarithms.iter().zip(&shaped).map(|(own, [value, ..])| own - value).collect());
        let (slopes, turns) = without_levels(shaped.iter().map(|[.., slope]| *slope).collect());
        let square = squares(&slopes);
        if square < 1e-20 {
            return None;
        }
        let step = slopes.iter().zip(&left).map(|(x, y)| x * y).sum::<f64>() / square;
        let before = values[0];
        values[0] = (before + step).clamp(first.low, first.high);
        let step = values[0] - before;
        for (place, level) in levels.iter_mut().enumerate() {
            *level += (rises[place] - step * turns[place]).clamp(-LONGEST_RISE, LONGEST_RISE);
        }
        last = Linear { left, weights, slopes };
        if step.abs() < 1e-6 * values[0].abs().max(1e-6) {
            break;
        }
    }
    let variance = squares(&last.left) / (data.freedom() - 1.0);
    let se = libm::sqrt(variance / squares(&last.slopes));
    let t = (values[0] - first.absent.unwrap_or(0.0)) / se;
    let mut result: Vec<(f64, Option<f64>)> = values.iter().map(|value| (*value, None)).collect();
    result[0].1 = Some(se);
    Some(Trend { kind, values: result, t, left_out_ratio: last.left_out_ratio(data, logarithms) })
}

/// Most steps of a trend's fit, and how far a condition's stiffness may go in one, as a logarithm.
const STEPS: usize = 12;
const LONGEST_RISE: f64 = 0.5;

fn squares(values: &[f64]) -> f64 {
    values.iter().map(|value| value * value).sum()
}

/// A trend about its optimum: what it leaves of each trial's logarithm, how that goes with the logarithm of its condition's
/// stiffness, and with the mechanism's value once these are free.
struct Linear {
    left: Vec<f64>,
    weights: Vec<f64>,
    slopes: Vec<f64>,
}

impl Linear {
    /// Leaving out each trial in turn: its deviation from the other repetitions, with the trend of all others and without.
    fn left_out_ratio(&self, data: &Stiffnesses, logarithms: &[f64]) -> f64 {
        let before = data.centred(logarithms);
        let square = squares(&self.slopes);
        let (mut with, mut without) = (0.0, 0.0);
        for (place, condition) in data.conditions.iter().enumerate() {
            let repetitions = || (0..data.trials.len()).filter(|other| data.conditions[*other] == *condition);
            let count = repetitions().count() as f64;
            if count < 2.0 {
                continue;
            }
            let weights: f64 = repetitions().map(|other| self.weights[other] * self.weights[other]).sum();
            let own = self.weights[place] * self.weights[place] / weights;
            let leverage = (own + self.slopes[place] * self.slopes[place] / square).min(0.95);
            let error = self.left[place] / (1.0 - leverage);
            with += error * error;
            let error = before[place] / (1.0 - 1.0 / count);
            without += error * error;
        }
        libm::sqrt(with / without.max(1e-30))
    }
}

/// How many times the trials are shuffled among the repetitions of their conditions.
const SHUFFLES: usize = 400;

/// The strongest trend, and how probable one as strong is where trials of a condition are exchangeable.
pub fn strongest_trend(
    prepared: &Prepared,
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
    Some((observed, super::calibrate::gumbel_tail(&maxima, strongest)))
}

/// The deviations handed out anew among all trials: under the hypothesis they are exchangeable, once those of conditions
/// with the same number of repetitions are on one scale.
fn shuffled_within(data: &Stiffnesses, centred: &[f64], stream: &mut Stream) -> Vec<f64> {
    let mut order: Vec<usize> = (0..data.trials.len()).collect();
    stream.shuffle(&mut order);
    order.iter().map(|place| centred[*place]).collect()
}

/// A trial that does not belong, with its deviation in standard deviations of the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Outlier {
    /// Index of the trial.
    pub trial: usize,
    /// Its stiffness over that of its repetitions.
    pub ratio: f64,
}

/// Trials whose stiffness is further from their repetitions than the spread of all allows, and the probability of the
/// furthest where all trials belong.
///
/// Each is compared with the nearest of the others of its condition; the spread is the median of these distances, which a
/// few outliers do not move. What the largest is by chance is simulated with the same conditions and repetitions.
pub fn outliers(data: &Stiffnesses, seed: u64) -> (Vec<Outlier>, f64) {
    let distances = distances(data, &data.logarithms);
    let spread = median(distances.iter().map(|d| d.abs()).collect());
    if spread <= 0.0 {
        return (Vec::new(), 1.0);
    }
    let mut stream = Stream::new(seed, "outliers");
    let mut maxima: Vec<f64> = (0..1000)
        .map(|_| {
            let normals: Vec<f64> = data.trials.iter().map(|_| stream.normal()).collect();
            let own = self::distances(data, &normals);
            let spread = median(own.iter().map(|d| d.abs()).collect());
            own.iter().map(|d| d.abs()).fold(0.0, f64::max) / spread
        })
        .collect();
    maxima.sort_by(f64::total_cmp);
    let beyond = |ratio: f64| {
        (maxima.iter().filter(|m| **m >= ratio).count() as f64 + 1.0) / (maxima.len() as f64 + 1.0)
    };
    let mut found = Vec::new();
    let mut left = data.clone_without(&[]);
    // One at a time: an outlier taken away no longer spoils the comparison of its repetitions.
    while let Some((place, ratio)) = furthest(&left, spread) {
        if beyond(ratio) > 0.01 || found.len() * 4 > data.trials.len() {
            break;
        }
        let distance = self::distances(&left, &left.logarithms)[place];
        found.push(Outlier { trial: left.trials[place], ratio: libm::exp(distance) });
        left = left.clone_without(&[left.trials[place]]);
    }
    let first = distances.iter().map(|d| d.abs()).fold(0.0, f64::max) / spread;
    (found, beyond(first))
}

impl Stiffnesses {
    fn clone_without(&self, except: &[usize]) -> Self {
        let kept: Vec<usize> =
            (0..self.trials.len()).filter(|i| !except.contains(&self.trials[*i])).collect();
        Self {
            trials: kept.iter().map(|i| self.trials[*i]).collect(),
            logarithms: kept.iter().map(|i| self.logarithms[*i]).collect(),
            conditions: kept.iter().map(|i| self.conditions[*i]).collect(),
        }
    }
}

fn furthest(data: &Stiffnesses, spread: f64) -> Option<(usize, f64)> {
    let distances = distances(data, &data.logarithms);
    let by_size = |a: &usize, b: &usize| distances[*a].abs().total_cmp(&distances[*b].abs());
    (0..distances.len()).max_by(by_size).map(|place| (place, distances[place].abs() / spread))
}

/// Each value less the nearest of the others of its condition.
fn distances(data: &Stiffnesses, values: &[f64]) -> Vec<f64> {
    (0..values.len())
        .map(|place| {
            let others: Vec<f64> = (0..values.len())
                .filter(|other| *other != place && data.conditions[*other] == data.conditions[place])
                .map(|other| values[other])
                .collect();
            if others.is_empty() {
                return 0.0;
            }
            // The mean of two would let one outlier make its neighbours look like two more.
            let nearest = others
                .iter()
                .copied()
                .min_by(|a, b| (a - values[place]).abs().total_cmp(&(b - values[place]).abs()));
            values[place] - nearest.unwrap_or(values[place])
        })
        .collect()
}

fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    if values.is_empty() { 0.0 } else { values[values.len() / 2] }
}

/// How x_e goes with velocity and torque.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct LimitLaw {
    /// x_0 of x_e = x_0 + v x_t, rad, with its standard error.
    pub x_0_rad: (f64, f64),
    /// x_t, s, with its standard error.
    pub x_t_s: (f64, f64),
    /// Change with torque, rad/(N m), with its standard error.
    pub per_torque_rad_per_nm: (f64, f64),
}

/// The regression of the elastic limits on velocity and torque; `None` if either does not vary, or too few are determined.
pub fn limit_law(prepared: &Prepared, fit: &Fit) -> Option<LimitLaw> {
    let limits: Vec<(f64, f64, f64)> = (0..prepared.trials.len())
        .filter(|trial| !fit.at_bound(*trial, 5))
        .map(|t| {
            (fit.parameters[t][5], prepared.trials[t].velocity_rad_s.abs(), prepared.trials[t].torque_nm)
        })
        .collect();
    let count = limits.len();
    if count < 9 {
        return None;
    }
    let mean_torque = limits.iter().map(|l| l.2).sum::<f64>() / count as f64;
    let design = DMatrix::from_fn(count, 3, |row, column| match column {
        0 => 1.0,
        1 => limits[row].1,
        _ => limits[row].2 - mean_torque,
    });
    let own = DVector::from_iterator(count, limits.iter().map(|l| l.0));
    let inverse = design.tr_mul(&design).try_inverse()?;
    let coefficients = &inverse * design.tr_mul(&own);
    let left = &own - &design * &coefficients;
    let variance = left.norm_squared() / (count as f64 - 3.0);
    let value = |i: usize| (coefficients[i], libm::sqrt(variance * inverse[(i, i)]));
    Some(LimitLaw { x_0_rad: value(0), x_t_s: value(1), per_torque_rad_per_nm: value(2) })
}
