//! Where a fit starts and what it may try. One pilot trial is searched widely, over scales read off its record, so that an
//! ankle starts as an ankle; the other trials start where the pilot ended.

use super::layout::Layout;
use super::model::{Model, Scope, Treatment};
use super::normal::{Objective, predict};
use super::prepare::{Prepared, PreparedTrial};
use super::solve::{Effort, solve};
use crate::random::Stream;
use crate::wrist::{BASE_PARAMETERS, Response};
use crate::wrist::mechanisms::Kind;

/// First values of each trial's six base parameters.
#[derive(Debug, Clone)]
pub struct Guess {
    trials: Vec<[f64; 6]>,
    /// Greatest angle of each trial's window, rad.
    reach_rad: Vec<f64>,
    lever: Option<crate::wrist::Lever>,
}

/// Where one coordinate may go.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// Least value.
    pub low: f64,
    /// Greatest value.
    pub high: f64,
    /// First value.
    pub start: f64,
}

/// How far from its first value a base parameter may go, as a factor: below and above. The elastic limit is bounded by the
/// angle that the motor reaches instead.
const FREEDOM: [(f64, f64); 5] = [(30.0, 30.0), (100.0, 30.0), (30.0, 60.0), (10.0, 10.0), (100.0, 15.0)];

impl Guess {
    /// Searches the pilot trial and hands its values to all.
    pub fn new(prepared: &Prepared) -> Self {
        let reach_rad: Vec<f64> = prepared.trials.iter().map(|trial| reach(prepared, trial)).collect();
        let pilot = pilot(prepared);
        let found = search(prepared, pilot, &reach_rad);
        let for_trial = |reach: &f64| {
            let mut own = found;
            own[5] *= reach / reach_rad[pilot];
            own
        };
        Self { trials: reach_rad.iter().map(for_trial).collect(), reach_rad, lever: prepared.lever }
    }

    /// The range of a parameter that `members` share.
    pub(super) fn range(
        &self,
        model: &Model,
        parameter: usize,
        treatment: &Treatment,
        members: &[usize],
    ) -> Range {
        let mut range = match parameter.checked_sub(BASE_PARAMETERS.len()) {
            None => self.base_range(parameter, members),
            Some(added) => self.added_range(model, added),
        };
        range.low = treatment.low.unwrap_or(range.low);
        range.high = treatment.high.unwrap_or(range.high);
        range.start = treatment.value.unwrap_or(range.start);
        if treatment.law.is_empty() {
            range.start = range.start.clamp(range.low, range.high);
        }
        range
    }

    fn base_range(&self, parameter: usize, members: &[usize]) -> Range {
        let geometric_mean = |value: &dyn Fn(usize) -> f64| {
            libm::exp(members.iter().map(|t| libm::log(value(*t))).sum::<f64>() / members.len() as f64)
        };
        let start = geometric_mean(&|trial| self.trials[trial][parameter]);
        match FREEDOM.get(parameter) {
            Some((below, above)) => Range { low: start / below, high: start * above, start },
            None => {
                let reach = geometric_mean(&|trial| self.reach_rad[trial]);
                Range { low: 0.03 * reach, high: 1.2 * reach, start }
            }
        }
    }

    fn added_range(&self, model: &Model, mut added: usize) -> Range {
        for switched in &model.mechanisms {
            if let Some(parameter) = switched.kind.parameters().get(added) {
                return Range {
                    low: parameter.low,
                    high: parameter.high,
                    start: self.typical(switched.kind, added),
                };
            }
            added -= switched.kind.parameter_count();
        }
        unreachable!("a model has as many parameters as its mechanisms say")
    }

    /// The lever's constants start at what the session states.
    fn typical(&self, kind: Kind, parameter: usize) -> f64 {
        match (kind, self.lever) {
            (Kind::LeverInertia, Some(lever)) => lever.inertia_kg_m2,
            (Kind::LeverStiffness, Some(lever)) => lever.stiffness_nm_per_rad,
            (Kind::LeverDamping, Some(lever)) => lever.damping_nm_s_per_rad,
            _ => kind.parameters()[parameter].typical,
        }
    }
}

/// Greatest angle in the window.
fn reach(prepared: &Prepared, trial: &PreparedTrial) -> f64 {
    let input = &trial.input;
    input.motion[input.onset..=input.onset + prepared.samples].iter().map(|k| k.theta).fold(1e-6, f64::max)
}

fn peak_nm(trial: &PreparedTrial) -> f64 {
    trial.measured_nm.iter().map(|t| t.abs()).fold(0.0, f64::max)
}

/// The trial with the median torque peak.
fn pilot(prepared: &Prepared) -> usize {
    let mut order: Vec<usize> = (0..prepared.trials.len()).collect();
    order.sort_by(|a, b| peak_nm(&prepared.trials[*a]).total_cmp(&peak_nm(&prepared.trials[*b])));
    order[order.len() / 2]
}

/// How many points of the pilot's parameter space are looked at, and from how many of the best a fit is tried.
const LOOKS: usize = 160;
const TRIES: usize = 4;

/// The best parameters of the pilot trial: many points, a fit from the best few.
fn search(prepared: &Prepared, pilot: usize, reach_rad: &[f64]) -> [f64; 6] {
    let mut alone = prepared.clone();
    alone.trials = vec![prepared.trials[pilot].clone()];
    alone.noise_of = vec![prepared.noise_of[pilot]];
    let mut looks = points(&alone, reach_rad[pilot]);
    let cost_of = |points: &[[f64; 6]]| {
        let trials = vec![0; points.len()];
        let mut response = Response::default();
        let flat: Vec<f64> = points.iter().flatten().copied().collect();
        predict(&alone, &[], &[], &trials, &flat, &mut response);
        let measured = &alone.trials[0].measured_nm;
        let cost = |torque: &[f64]| torque.iter().zip(measured).map(|(p, m)| (p - m) * (p - m)).sum::<f64>();
        response.torque_nm.chunks_exact(alone.samples).map(cost).collect::<Vec<f64>>()
    };
    let costs = cost_of(&looks);
    let mut order: Vec<usize> = (0..looks.len()).filter(|i| costs[*i].is_finite()).collect();
    order.sort_by(|a, b| costs[*a].total_cmp(&costs[*b]));
    let mut best = (f64::INFINITY, looks[order.first().copied().unwrap_or(0)]);
    let mut model = Model::paper();
    model.base.iter_mut().for_each(|treatment| *treatment = Treatment::free(Scope::Trial));
    for index in order.into_iter().take(TRIES) {
        let start = Guess { trials: vec![looks[index]], reach_rad: vec![reach_rad[pilot]], lever: alone.lever };
        let layout = Layout::new(&alone, &model, &start);
        let solution =
            solve(&alone, &layout, &[], &Objective::LeastSquares, &layout.start(), Effort::default());
        if solution.outcomes[0].cost < best.0 {
            let mut found = Vec::new();
            layout.parameters(0, &solution.coordinates, &mut found);
            looks[index].copy_from_slice(&found);
            best = (solution.outcomes[0].cost, looks[index]);
        }
    }
    best.1
}

/// Points of the parameter space, log-uniform about scales of the record.
fn points(alone: &Prepared, reach_rad: f64) -> Vec<[f64; 6]> {
    let trial = &alone.trials[0];
    let peak = peak_nm(trial);
    // The first peak is that of the inertias gaining speed.
    let top_speed = trial.input.motion.iter().map(|k| k.omega).fold(1e-3, f64::max);
    let peak_at = trial.measured_nm.iter().position(|t| t.abs() == peak).unwrap_or(1).max(1);
    let inertia = 0.5 * peak * peak_at as f64 * alone.period_s / top_speed;
    let stiffness = peak / reach_rad;
    let mut stream = Stream::new(0, "pilot");
    let mut spread = |low: f64, high: f64| low * libm::exp(stream.uniform() * libm::log(high / low));
    (0..LOOKS)
        .map(|_| {
            let i_j = inertia * spread(0.1, 3.0);
            let k_srs = stiffness * spread(0.1, 5.0);
            let k_h = k_srs * spread(3.0, 60.0);
            let b_h = 2.0 * spread(0.05, 1.0) * libm::sqrt(k_h * i_j);
            [i_j, b_h, k_h, k_srs, k_srs * spread(0.2, 0.9), reach_rad * spread(0.2, 0.8)]
        })
        .collect()
}
