//! Where a fit starts and what it may try: values read off the record, so that an ankle starts as an ankle.

use super::model::{Model, Treatment};
use super::prepare::{Prepared, PreparedTrial};
use crate::wrist::BASE_PARAMETERS;
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
    /// Reads first values off the records.
    pub fn new(prepared: &Prepared) -> Self {
        Self {
            trials: prepared.trials.iter().map(|trial| guess(prepared, trial)).collect(),
            reach_rad: prepared.trials.iter().map(|trial| reach(prepared, trial)).collect(),
            lever: prepared.lever,
        }
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

/// Inertia off the first torque peak, stiffness off the end of the window, the rest in proportion.
fn guess(prepared: &Prepared, trial: &PreparedTrial) -> [f64; 6] {
    let reach = reach(prepared, trial);
    let tail = &trial.measured_nm[prepared.samples - prepared.samples / 5..];
    let last = tail.iter().sum::<f64>() / tail.len() as f64;
    let slope = (last / reach).max(0.5);
    // While the motor gains speed the torque is that of the inertias: the integral of torque is inertia times speed.
    let top_speed = trial.input.motion.iter().map(|k| k.omega).fold(1e-3, f64::max);
    let peak = (trial.measured_nm.iter().enumerate())
        .fold((0, 0.0), |best, (i, t)| if *t > best.1 { (i, *t) } else { best });
    let early = prepared.samples.min((2 * peak.0).max(prepared.samples / 8)).min(prepared.samples / 2);
    let impulse: f64 = trial.measured_nm[..early].iter().sum::<f64>() * prepared.period_s;
    let spring: f64 = (trial.input.motion[trial.input.onset..trial.input.onset + early].iter())
        .map(|k| 0.5 * slope * k.theta.max(0.0))
        .sum::<f64>()
        * prepared.period_s;
    let lever_inertia = prepared.lever.map_or(0.0, |lever| lever.inertia_kg_m2);
    let inertia =
        ((impulse - spring) / top_speed - lever_inertia).clamp(2e-4 * slope.min(50.0) / 5.0, 2e-4 * slope);
    let interface = 15.0 * slope;
    let damping = 1.0 * libm::sqrt(interface * inertia);
    [inertia, damping, interface, 1.4 * slope, 0.7 * slope, 0.55 * reach]
}
