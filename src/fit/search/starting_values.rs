//! Where a fit starts and what it may try. One pilot trial is looked at widely, over scales read off its record, so that an
//! ankle starts as an ankle; a fit of few parameters to some trials goes on from there, and all trials start where it ends.

use crate::fit::data::preprocessing::{Observations, TrialObservation};
use crate::fit::model::specification::{Model, ParameterSpec, Scope};
use crate::fit::parameters::parameterisation::{Component, Coordinate, Parameterisation, Transform};
use crate::fit::residuals::prediction::predict;
use crate::fit::solver::levenberg_marquardt::{SolverOptions, solve};
use crate::fit::solver::normal_equations::Objective;
use crate::random::Stream;
use crate::wrist::{BASE_PARAMETERS, SimulatedTorque};

/// First values of each trial's six base parameters.
#[derive(Debug, Clone)]
pub struct StartingValues {
    trials: Vec<[f64; 6]>,
    /// First values of the mechanisms' parameters, if they took part in it.
    added: Vec<f64>,
    /// Greatest angle of each trial's window, rad.
    peak_angle_rad: Vec<f64>,
    lever: Option<crate::wrist::Lever>,
}

/// Where one coordinate may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BoundedStart {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// First value.
    pub start: f64,
}

/// Bounds of the elastic limit, as parts of the way that the motor goes in the window.
const LEAST_LIMIT: f64 = 0.08;
const MOST_LIMIT: f64 = 1.05;

/// How far from its first value a base parameter may go, as a factor: below and above. The elastic limit is bounded by the
/// angle that the motor reaches instead.
const FREEDOM: [(f64, f64); 5] = [(8.0, 8.0), (30.0, 10.0), (8.0, 12.0), (5.0, 5.0), (20.0, 8.0)];

impl StartingValues {
    /// Fits a few parameters that some trials share, from each of `points` (the pilot's, see [`pilot_points`]), and hands what came
    /// out to all trials: the shared fit is determined well enough to have few optima where single trials have many. The best
    /// comes first, then others whose elastic limit lies restart_point.
    /// The mechanisms of `model` take part: without one that is at work, the others start where it drove them.
    pub fn pooled(
        observations: &Observations,
        objective: &Objective,
        points: &[[f64; 6]],
        model: &Model,
    ) -> Vec<Self> {
        let kinds = model.kinds();
        let peak_angle_rad: Vec<f64> =
            (0..observations.trials.len()).map(|trial| observations.peak_angle_rad(trial)).collect();
        let some = representatives(observations);
        let few = observations.subset(&some);
        let mut starts: Vec<(f64, PooledFit, Vec<f64>)> = Vec::new();
        for point in points {
            for place in LIMIT_PLACES {
                let mut point = *point;
                point[5] = place;
                let pooled = PooledFit::new(&few, &point, model);
                let start = pooled.parameterisation.start();
                starts.push((f64::INFINITY, pooled, start));
            }
        }
        // Rivals fall behind within a few steps: only the best go on.
        for (round, options) in APPROACH.into_iter().enumerate() {
            starts.truncate(starts.len().div_ceil(1 + round));
            for (cost, pooled, at) in &mut starts {
                let solution = solve(&few, &pooled.parameterisation, &kinds, objective, at, options);
                *cost = solution.cost();
                *at = solution.coordinates;
            }
            starts.sort_by(|a, b| a.0.total_cmp(&b.0));
        }
        let starting_values = |(_, pooled, coordinates): (f64, PooledFit, Vec<f64>)| {
            let own = |(trial, reach): (&TrialObservation, &f64)| {
                pooled.values(&coordinates, trial.torque_nm, *reach)
            };
            let trials = observations.trials.iter().zip(&peak_angle_rad).map(own).collect();
            let added = pooled.added(&coordinates);
            Self { trials, added, peak_angle_rad: peak_angle_rad.clone(), lever: observations.lever }
        };
        let mut different: Vec<Self> = Vec::new();
        for own in starts.into_iter().map(starting_values) {
            let limit = own.median_values()[5];
            let is_near = |other: &Self| libm::log(limit / other.median_values()[5]).abs() < ELSEWHERE;
            if !different.iter().any(is_near) {
                different.push(own);
            }
        }
        if different.is_empty() {
            let trials = vec![[1e-3, 1.0, 100.0, 10.0, 5.0, 0.01]; observations.trials.len()];
            different.push(Self { trials, added: Vec::new(), peak_angle_rad, lever: observations.lever });
        }
        different
    }

    /// First values that are given: each trial's six base parameters.
    ///
    /// # Panics
    /// If there is not one for each trial.
    pub fn given(observations: &Observations, trials: Vec<[f64; 6]>) -> Self {
        assert_eq!(trials.len(), observations.trials.len(), "first values for every trial");
        let peak_angle_rad =
            (0..observations.trials.len()).map(|trial| observations.peak_angle_rad(trial)).collect();
        Self { trials, added: Vec::new(), peak_angle_rad, lever: observations.lever }
    }

    /// First values that are known already, trial by trial; those of mechanisms as the model says.
    pub fn at(observations: &Observations, parameters: &[Vec<f64>]) -> Self {
        let own = |values: &Vec<f64>| {
            let mut six = [0.0; 6];
            six.copy_from_slice(&values[..BASE_PARAMETERS.len()]);
            six
        };
        Self {
            trials: parameters.iter().map(own).collect(),
            added: Vec::new(),
            peak_angle_rad: (0..observations.trials.len())
                .map(|trial| observations.peak_angle_rad(trial))
                .collect(),
            lever: observations.lever,
        }
    }

    /// The first value of a trial's base parameter.
    pub fn value(&self, trial: usize, parameter: usize) -> f64 {
        self.trials[trial][parameter]
    }

    /// The median of each parameter over the trials.
    pub fn median_values(&self) -> [f64; 6] {
        std::array::from_fn(|parameter| {
            median(&self.trials.iter().map(|own| own[parameter]).collect::<Vec<_>>())
        })
    }

    /// The same for some of the trials.
    pub fn subset(&self, trials: &[usize]) -> Self {
        Self {
            trials: trials.iter().map(|trial| self.trials[*trial]).collect(),
            added: self.added.clone(),
            peak_angle_rad: trials.iter().map(|trial| self.peak_angle_rad[*trial]).collect(),
            lever: self.lever,
        }
    }

    /// The range of a parameter that `members` share.
    pub(in crate::fit) fn range(
        &self,
        model: &Model,
        parameter: usize,
        treatment: &ParameterSpec,
        members: &[usize],
    ) -> BoundedStart {
        let mut range = match parameter.checked_sub(BASE_PARAMETERS.len()) {
            None => self.base_range(parameter, members),
            Some(added) => self.added_range(model, added),
        };
        range.low = treatment.low.unwrap_or(range.low);
        range.high = treatment.high.unwrap_or(range.high);
        let found = parameter.checked_sub(BASE_PARAMETERS.len()).and_then(|added| self.added.get(added));
        range.start = found.copied().or(treatment.value).unwrap_or(range.start);
        if treatment.law.is_empty() {
            range.start = range.start.clamp(range.low, range.high);
        }
        range
    }

    fn base_range(&self, parameter: usize, members: &[usize]) -> BoundedStart {
        let geometric_mean = |value: &dyn Fn(usize) -> f64| {
            libm::exp(members.iter().map(|t| libm::log(value(*t))).sum::<f64>() / members.len() as f64)
        };
        let start = geometric_mean(&|trial| self.trials[trial][parameter]);
        match FREEDOM.get(parameter) {
            Some((below, above)) => BoundedStart { low: start / below, high: start * above, start },
            None => {
                let reach = geometric_mean(&|trial| self.peak_angle_rad[trial]);
                BoundedStart { low: LEAST_LIMIT * reach, high: MOST_LIMIT * reach, start }
            }
        }
    }

    fn added_range(&self, model: &Model, mut added: usize) -> BoundedStart {
        for switched in &model.mechanisms {
            if let Some(parameter) = switched.kind.parameters().get(added) {
                return BoundedStart {
                    low: parameter.low,
                    high: parameter.high,
                    start: switched.kind.starting_value(added, self.lever),
                };
            }
            added -= switched.kind.parameter_count();
        }
        unreachable!("a model has as many parameters as its mechanisms say")
    }
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted[sorted.len() / 2]
}

fn peak_nm(trial: &TrialObservation) -> f64 {
    trial.measured_nm.iter().map(|t| t.abs()).fold(0.0, f64::max)
}

/// The trial with the median torque peak.
fn pilot(observations: &Observations) -> usize {
    let mut order: Vec<usize> = (0..observations.trials.len()).collect();
    order.sort_by(|a, b| peak_nm(&observations.trials[*a]).total_cmp(&peak_nm(&observations.trials[*b])));
    order[order.len() / 2]
}

/// How many points of the pilot's parameter space are looked at, and how many of the best are handed on.
const LOOKS: usize = 128;
const KEPT: usize = 2;

/// Where the elastic limit starts, as a part of the way that the motor goes in the window.
const LIMIT_PLACES: [f64; 3] = [0.35, 0.5, 0.65];

/// A change of the logarithm of the elastic limit that makes another starting_values.
const ELSEWHERE: f64 = 0.2;

/// The shared fit need not be exact; half of the starts go on after the first round.
const APPROACH: [SolverOptions; 2] = [
    SolverOptions { max_iterations: 6, tolerance: 1e-2, max_log_step: 0.7 },
    SolverOptions { max_iterations: 30, tolerance: 1e-3, max_log_step: 0.7 },
];

/// The most promising points of the pilot trial's parameter space, best first, by the sum of squares.
pub fn pilot_points(observations: &Observations) -> Vec<[f64; 6]> {
    let pilot = observations.subset(&[pilot(observations)]);
    let points = points(&pilot, pilot.peak_angle_rad(0));
    let flat: Vec<f64> = points.iter().flatten().copied().collect();
    let mut response = SimulatedTorque::default();
    predict(&pilot, &[], &[], &vec![0; points.len()], &flat, &mut response);
    let measured = &pilot.trials[0].measured_nm;
    let cost = |torque: &[f64]| torque.iter().zip(measured).map(|(p, m)| (p - m) * (p - m)).sum::<f64>();
    let mut ranked: Vec<(f64, [f64; 6])> = response
        .torque_nm
        .chunks_exact(pilot.samples)
        .map(cost)
        .zip(points)
        .filter(|(c, _)| c.is_finite())
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0));
    ranked.into_iter().take(KEPT).map(|(_, point)| point).collect()
}

/// Up to eight trials, as many as go through the model at once: spread over velocities and torques.
fn representatives(observations: &Observations) -> Vec<usize> {
    let count = observations.trials.len();
    let most = count.min(8);
    (0..most).map(|i| (2 * i + 1) * count / (2 * most)).collect()
}

/// Few parameters for many trials: inertia, interface and decrement in common, k_srs by torque, x_e as a part of the way and an
/// angle that is the same in all.
struct PooledFit {
    parameterisation: Parameterisation,
    torques: Vec<f64>,
    middle_reach_rad: f64,
}

/// BlockIndex of the elastic limit's first coordinate.
const LIMIT: usize = 4;

impl PooledFit {
    fn new(few: &Observations, point: &[f64; 6], model: &Model) -> Self {
        let mut torques: Vec<f64> = few.trials.iter().map(|trial| trial.torque_nm).collect();
        torques.sort_by(f64::total_cmp);
        torques.dedup();
        let coordinate = |parameter: usize| {
            let (below, above) = FREEDOM.get(parameter).copied().unwrap_or((4.0, 2.0));
            let start = libm::log(point[parameter]);
            Coordinate {
                parameter,
                term: None,
                logarithmic: true,
                low: start - libm::log(below),
                high: start + libm::log(above),
                start,
                scale: 1.0,
                prior: None,
            }
        };
        let mut coordinates: Vec<Coordinate> = [0, 1, 2, 4, 5].into_iter().map(coordinate).collect();
        // The elastic limit: parts of the way, and of the median way.
        let ways: Vec<f64> = (0..few.trials.len()).map(|trial| few.peak_angle_rad(trial)).collect();
        let median_values = median(&ways);
        coordinates[LIMIT] = Coordinate {
            logarithmic: false,
            low: -0.3,
            high: 1.5,
            start: point[5],
            ..coordinates[LIMIT].clone()
        };
        coordinates.push(Coordinate {
            low: -0.5,
            high: 0.5,
            start: 0.0,
            scale: 0.1,
            ..coordinates[LIMIT].clone()
        });
        let first_stiffness = coordinates.len();
        coordinates.extend(torques.iter().map(|_| coordinate(3)));
        let starting_values = StartingValues::given(few, vec![*point; few.trials.len()]);
        let added: Vec<Transform> = model.treatments()[BASE_PARAMETERS.len()..]
            .iter()
            .enumerate()
            .map(|(added, treatment)| {
                let parameter = BASE_PARAMETERS.len() + added;
                if treatment.scope == Scope::Fixed {
                    return Transform::Fixed(treatment.value.unwrap_or(0.0));
                }
                let (own, link) =
                    Coordinate::of(parameter, starting_values.range(model, parameter, treatment, &[]));
                coordinates.push(own);
                link(coordinates.len() - 1)
            })
            .collect();
        let estimated = (0..BASE_PARAMETERS.len())
            .chain(
                (0..added.len())
                    .filter(|i| !matches!(added[*i], Transform::Fixed(_)))
                    .map(|i| BASE_PARAMETERS.len() + i),
            )
            .collect();
        let link = |coordinate: usize| Transform::Logarithmic { coordinate, factor: 1.0 };
        let links = |(index, trial): (usize, &TrialObservation)| {
            let level = torques.iter().position(|torque| *torque == trial.torque_nm).unwrap_or(0);
            let way = Transform::Sum(vec![(LIMIT, ways[index]), (LIMIT + 1, median_values)]);
            let base = [link(0), link(1), link(2), link(first_stiffness + level), link(3), way];
            base.into_iter().chain(added.iter().cloned()).collect()
        };
        let component = Component {
            trials: (0..few.trials.len()).collect(),
            blocks: vec![Vec::new()],
            block_of_trial: vec![0; few.trials.len()],
            border: (0..coordinates.len()).collect(),
            border_prior: None,
        };
        let parameterisation = Parameterisation {
            transforms: few.trials.iter().enumerate().map(links).collect(),
            coordinates,
            components: vec![component],
            estimated,
        };
        Self { parameterisation, torques, middle_reach_rad: median_values }
    }

    /// The parameters of a trial at this torque, where the motor goes so far.
    fn values(&self, coordinates: &[f64], torque_nm: f64, peak_angle_rad: f64) -> [f64; 6] {
        let nearest = (0..self.torques.len())
            .min_by(|a, b| {
                (self.torques[*a] - torque_nm).abs().total_cmp(&(self.torques[*b] - torque_nm).abs())
            })
            .unwrap_or(0);
        let value = |coordinate: usize| libm::exp(coordinates[coordinate]);
        let limit = coordinates[LIMIT] * peak_angle_rad + coordinates[LIMIT + 1] * self.middle_reach_rad;
        let limit = limit.clamp(LEAST_LIMIT * peak_angle_rad, MOST_LIMIT * peak_angle_rad);
        [value(0), value(1), value(2), value(LIMIT + 2 + nearest), value(3), limit]
    }

    /// The parameters of the mechanisms.
    fn added(&self, coordinates: &[f64]) -> Vec<f64> {
        let mut values = Vec::new();
        self.parameterisation.parameters(0, coordinates, &mut values);
        values.split_off(BASE_PARAMETERS.len())
    }
}

/// Points of the parameter space, log-uniform about scales of the record.
fn points(alone: &Observations, peak_angle_rad: f64) -> Vec<[f64; 6]> {
    let trial = &alone.trials[0];
    let peak = peak_nm(trial);
    // The first peak is that of the inertias gaining speed.
    let top_speed = trial.input.motion.iter().map(|k| k.omega).fold(1e-3, f64::max);
    let peak_at = trial.measured_nm.iter().position(|t| t.abs() == peak).unwrap_or(1).max(1);
    let inertia = 0.5 * peak * peak_at as f64 * alone.period_s / top_speed;
    let stiffness = peak / peak_angle_rad;
    let mut stream = Stream::new(0, "pilot");
    let mut spread = |low: f64, high: f64| low * libm::exp(stream.uniform() * libm::log(high / low));
    (0..LOOKS)
        .map(|_| {
            let i_j = inertia * spread(0.1, 3.0);
            let k_srs = stiffness * spread(0.1, 5.0);
            let k_h = k_srs * spread(3.0, 60.0);
            let b_h = 2.0 * spread(0.05, 1.0) * libm::sqrt(k_h * i_j);
            [i_j, b_h, k_h, k_srs, k_srs * spread(0.2, 0.9), peak_angle_rad * spread(0.3, 0.8)]
        })
        .collect()
}
