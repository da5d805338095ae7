//! Pooled fit: few parameters fitted to a few trials at once, whose optimum gives starting values for all trials.
//!
//! A pooled fit is determined well enough to have few optima where single trials have many.

use crate::fit::data::observations::{Observations, TrialObservation};
use crate::fit::model::parameter_index::{B_H, I_J, K_DEC, K_H, K_SRS, X_E};
use crate::fit::model::specification::{Model, Scope};
use crate::fit::parameters::component::Component;
use crate::fit::parameters::coordinate::{Coordinate, Transform};
use crate::fit::parameters::parameterisation::Parameterisation;
use crate::fit::parameters::starting_values::{BOUND_FACTORS, StartingValues, x_e_bounds};
use crate::fit::residuals::objective::Objective;
use crate::fit::solver::levenberg_marquardt::solve;
use crate::fit::solver::options::SolverOptions;
use crate::statistics::upper_median;
use crate::wrist::BASE_PARAMETERS;

/// Starting values of x_e, as fractions of the largest motor angle in the window.
const X_E_FRACTIONS: [f64; 3] = [0.35, 0.5, 0.65];

/// Change of log x_e that makes starting values different from others.
const DISTINCT_START_LOG_X_E: f64 = 0.2;

/// Rounds of the pooled fits: the better half of the starts continues after the first round. A pooled fit need not be exact.
const POOLED_ROUNDS: [SolverOptions; 2] = [
    SolverOptions { max_iterations: 6, tolerance: 1e-2, max_log_step: 0.7 },
    SolverOptions { max_iterations: 30, tolerance: 1e-3, max_log_step: 0.7 },
];

/// Largest number of trials in a pooled fit: as many as the model simulates at once.
const MAX_TRIALS: usize = 8;

/// Starting values of all trials from pooled fits that begin at each of `points`, the best points of the pilot search. The best
/// come first, then those with another elastic limit.
///
/// The mechanisms of `model` are part of the pooled fits. Without a mechanism that is active, the other parameters would start
/// where its absence drives them.
pub fn pooled_starting_values(
    observations: &Observations,
    objective: &Objective,
    points: &[[f64; 6]],
    model: &Model,
) -> Vec<StartingValues> {
    let kinds = model.kinds();
    let few = observations.subset(&spread_trials(observations));
    let mut fits: Vec<(f64, PooledFit, Vec<f64>)> = Vec::new();
    for point in points {
        for fraction in X_E_FRACTIONS {
            let mut point = *point;
            point[X_E] = fraction;
            let pooled = PooledFit::new(&few, &point, model);
            let start = pooled.parameterisation.start();
            fits.push((f64::INFINITY, pooled, start));
        }
    }
    for (round, options) in POOLED_ROUNDS.into_iter().enumerate() {
        fits.truncate(fits.len().div_ceil(1 + round));
        for (cost, pooled, coordinates) in &mut fits {
            let solution = solve(&few, &pooled.parameterisation, &kinds, objective, coordinates, options);
            *cost = solution.cost();
            *coordinates = solution.coordinates;
        }
        fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    let mut distinct: Vec<StartingValues> = Vec::new();
    for (_, pooled, coordinates) in fits {
        let values = pooled.starting_values(observations, &coordinates);
        let x_e = values.median_values()[X_E];
        let is_near = |other: &StartingValues| {
            libm::log(x_e / other.median_values()[X_E]).abs() < DISTINCT_START_LOG_X_E
        };
        if !distinct.iter().any(is_near) {
            distinct.push(values);
        }
    }
    if distinct.is_empty() {
        distinct.push(StartingValues::default_for(observations));
    }
    distinct
}

/// Indices of up to [`MAX_TRIALS`] trials, spread over velocities and torques.
fn spread_trials(observations: &Observations) -> Vec<usize> {
    let count = observations.trials.len();
    let most = count.min(MAX_TRIALS);
    (0..most).map(|i| (2 * i + 1) * count / (2 * most)).collect()
}

/// A pooled fit: I_j, b_h, k_h and k_dec shared by all trials, k_srs by the trials of a torque, and x_e the sum of a fraction of the
/// largest motor angle and a constant.
struct PooledFit {
    parameterisation: Parameterisation,
    /// The target torques, N m, in ascending order.
    torques: Vec<f64>,
    median_peak_angle_rad: f64,
}

/// Index of the first of the two coordinates of x_e; the coordinates before it are the parameters shared by all trials, those
/// after it k_srs by torque, then the mechanisms.
const X_E_COORDINATE: usize = 4;

impl PooledFit {
    /// A pooled fit to the trials of `few` that starts at `point`, in which x_e is a fraction of the largest motor angle.
    fn new(few: &Observations, point: &[f64; 6], model: &Model) -> Self {
        let mut torques: Vec<f64> = few.trials.iter().map(|trial| trial.torque_nm).collect();
        torques.sort_by(f64::total_cmp);
        torques.dedup();
        let coordinate = |parameter: usize| {
            let (below, above) = BOUND_FACTORS.get(parameter).copied().unwrap_or((4.0, 2.0));
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
        let mut coordinates: Vec<Coordinate> =
            [I_J, B_H, K_H, K_DEC, X_E].into_iter().map(coordinate).collect();
        // x_e: a fraction of the trial's largest angle, and a fraction of the median largest angle.
        let peak_angles: Vec<f64> = (0..few.trials.len()).map(|trial| few.peak_angle_rad(trial)).collect();
        let median_peak_angle = upper_median(peak_angles.iter().copied()).unwrap_or(f64::NAN);
        coordinates[X_E_COORDINATE] = Coordinate {
            logarithmic: false,
            low: -0.3,
            high: 1.5,
            start: point[X_E],
            ..coordinates[X_E_COORDINATE].clone()
        };
        coordinates.push(Coordinate {
            low: -0.5,
            high: 0.5,
            start: 0.0,
            scale: 0.1,
            ..coordinates[X_E_COORDINATE].clone()
        });
        let first_k_srs = coordinates.len();
        coordinates.extend(torques.iter().map(|_| coordinate(K_SRS)));
        let starting_values = StartingValues::new(few, vec![*point; few.trials.len()]);
        let added: Vec<Transform> = model.parameter_specs()[BASE_PARAMETERS.len()..]
            .iter()
            .enumerate()
            .map(|(added, spec)| {
                let parameter = BASE_PARAMETERS.len() + added;
                if spec.scope == Scope::Fixed {
                    return Transform::Fixed(spec.value.unwrap_or(0.0));
                }
                let bounds = starting_values.bounds(model, parameter, spec, &[]);
                let (own, transform) = Coordinate::of(parameter, bounds);
                coordinates.push(own);
                transform(coordinates.len() - 1)
            })
            .collect();
        let is_estimated = |added: &Transform| !matches!(added, Transform::Fixed(_));
        let estimated_added = (0..added.len()).filter(|i| is_estimated(&added[*i]));
        let estimated =
            (0..BASE_PARAMETERS.len()).chain(estimated_added.map(|i| BASE_PARAMETERS.len() + i)).collect();
        let shared = |coordinate: usize| Transform::Logarithmic { coordinate, factor: 1.0 };
        let transforms = |(index, trial): (usize, &TrialObservation)| {
            let torque = torques.iter().position(|torque| *torque == trial.torque_nm).unwrap_or(0);
            let x_e = Transform::Sum(vec![
                (X_E_COORDINATE, peak_angles[index]),
                (X_E_COORDINATE + 1, median_peak_angle),
            ]);
            let base = [shared(0), shared(1), shared(2), shared(first_k_srs + torque), shared(3), x_e];
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
            transforms: few.trials.iter().enumerate().map(transforms).collect(),
            coordinates,
            components: vec![component],
            estimated,
        };
        Self { parameterisation, torques, median_peak_angle_rad: median_peak_angle }
    }

    /// Starting values of all trials of a session from the optimum of the pooled fit.
    fn starting_values(&self, observations: &Observations, coordinates: &[f64]) -> StartingValues {
        let trials = (0..observations.trials.len()).map(|trial| {
            let torque_nm = observations.trials[trial].torque_nm;
            self.base_parameters(coordinates, torque_nm, observations.peak_angle_rad(trial))
        });
        let mut first = Vec::new();
        self.parameterisation.parameters(0, coordinates, &mut first);
        let mechanisms = first.split_off(BASE_PARAMETERS.len());
        StartingValues::with_mechanisms(observations, trials.collect(), mechanisms)
    }

    /// Base parameters of a trial of target torque `torque_nm` and largest motor angle `peak_angle_rad`; k_srs is that of the
    /// nearest torque.
    fn base_parameters(&self, coordinates: &[f64], torque_nm: f64, peak_angle_rad: f64) -> [f64; 6] {
        let nearest = (0..self.torques.len())
            .min_by(|a, b| {
                (self.torques[*a] - torque_nm).abs().total_cmp(&(self.torques[*b] - torque_nm).abs())
            })
            .unwrap_or(0);
        let value = |coordinate: usize| libm::exp(coordinates[coordinate]);
        let x_e = coordinates[X_E_COORDINATE] * peak_angle_rad
            + coordinates[X_E_COORDINATE + 1] * self.median_peak_angle_rad;
        let (low, high) = x_e_bounds(peak_angle_rad);
        let x_e = x_e.clamp(low, high);
        [value(0), value(1), value(2), value(X_E_COORDINATE + 2 + nearest), value(3), x_e]
    }
}
