//! Whether the model of the rig describes the rig trials, as a whole and load by load.

use nalgebra::{DMatrix, DVector};

use super::constants::FIRST_KNOWN;
use super::error::CalibrateError;
use super::fit::{RigFit, RigFitInput, RigTrialEquations};
use super::linear_algebra::inverse;
use super::moments::MomentChannel;
use super::prepared_trial::PreparedTrial;
use crate::protocol::RigLoad;
use crate::random::Stream;

/// Residuals drawn under the fitted model for the reference distribution.
const MISFIT_DRAWS: usize = 999;

/// Residual of the trials with one load.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadResidual {
    /// The load, with its direction.
    pub load: RigLoad,
    /// Number of trials.
    pub trials: usize,
    /// Root mean square of the residual beside what noise and encoder make; 1 if the model is right.
    pub ratio: f64,
    /// Probability of a residual this large if the model is right.
    pub p_value: f64,
}

/// Misfit of the model to the trials.
#[derive(Debug, Clone, PartialEq)]
pub struct RigMisfit {
    /// Probability of a misfit this large, beside the scatter of repetitions, if the model is right.
    pub p_value: f64,
    /// Of the servo: probability of residuals this large if the motor follows its target as a second order does.
    pub servo_p_value: f64,
    /// Residual of each load.
    pub loads: Vec<LoadResidual>,
}

/// Places of the trials with the same load and motion.
pub fn cells(trials: &[PreparedTrial]) -> Vec<Vec<usize>> {
    let mut found: Vec<Vec<usize>> = Vec::new();
    for (place, trial) in trials.iter().enumerate() {
        let is_own = |cell: &&mut Vec<usize>| {
            let first = &trials[cell[0]];
            first.load == trial.load && first.motion == trial.motion
        };
        match found.iter_mut().find(is_own) {
            Some(cell) => cell.push(place),
            None => found.push(vec![place]),
        }
    }
    found
}

/// Sum of squares of moments of a channel about their means within cells, and its degrees of freedom.
pub fn scatter_within(
    cells: &[Vec<usize>],
    equations: &[RigTrialEquations],
    standardised: &[DVector<f64>],
    channel: MomentChannel,
) -> (f64, f64) {
    let (mut sum, mut freedom) = (0.0, 0.0);
    for cell in cells.iter().filter(|cell| cell.len() > 1) {
        for (row, label) in
            equations[cell[0]].labels.iter().enumerate().filter(|(_, own)| own.channel == channel)
        {
            let values: Option<Vec<f64>> = cell
                .iter()
                .map(|trial| {
                    // Trials of a cell mostly have the same moments in the same places.
                    let labels = &equations[*trial].labels;
                    let place = if labels.get(row) == Some(label) {
                        Some(row)
                    } else {
                        labels.iter().position(|own| own == label)
                    };
                    place.map(|place| standardised[*trial][place])
                })
                .collect();
            let Some(values) = values else { continue };
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            sum += values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
            freedom += values.len() as f64 - 1.0;
        }
    }
    (sum, freedom)
}

/// The statistics that are compared with their reference distribution.
struct RigMisfitStatistics {
    whole: f64,
    servo: f64,
    loads: Vec<f64>,
}

/// Tests the misfit of a fit.
///
/// # Errors
/// If the information of the trials has no inverse.
pub fn misfit(
    input: &RigFitInput<'_>,
    fit: &RigFit,
    stream: &mut Stream,
) -> Result<RigMisfit, CalibrateError> {
    let size = input.coordinates.count();
    let cells = cells(input.trials);
    let mut loads: Vec<(RigLoad, Vec<usize>)> = Vec::new();
    for (place, trial) in input.trials.iter().enumerate() {
        match loads.iter_mut().find(|(load, _)| *load == trial.load) {
            Some((_, places)) => places.push(place),
            None => loads.push((trial.load, vec![place])),
        }
    }
    let observed: Vec<DVector<f64>> = fit.equations.iter().map(|own| own.residual.clone()).collect();
    let statistics = statistics(fit, &cells, &loads, &observed);
    let precision = input.prior.precision.diagonal();
    let inverse = inverse(DMatrix::from_diagonal(&precision) + fit.information())
        .ok_or(CalibrateError::NoCovariance("the covariance of the fitted constants"))?;
    let noise: Vec<DMatrix<f64>> =
        fit.equations.iter().map(|own| square_root(&own.noise_covariance)).collect();
    let positions = fit.equations.first().map_or(0, |own| own.step_errors.len());
    let mut exceeded = RigMisfitStatistics { whole: 1.0, servo: 1.0, loads: vec![1.0; loads.len()] };
    let mut sums = vec![0.0; loads.len()];
    for _ in 0..MISFIT_DRAWS {
        let position = stream.below(positions.max(1) as u64) as usize;
        let mut drawn: Vec<DVector<f64>> = fit
            .equations
            .iter()
            .zip(&noise)
            .map(|(own, root)| {
                let normals = DVector::from_fn(root.ncols(), |_, _| stream.normal());
                let noise = root * normals;
                own.step_errors.get(position).map_or(noise.clone(), |error| noise + error)
            })
            .collect();
        // What is known beforehand, such as the stated values of the loads, is wrong by its own error.
        let mut score = DVector::from_fn(size, |place, _| {
            if place < FIRST_KNOWN { 0.0 } else { libm::sqrt(precision[place]) * stream.normal() }
        });
        for (own, residual) in fit.equations.iter().zip(&drawn) {
            score += own.jacobian.transpose() * residual;
        }
        let fitted = &inverse * score;
        for (own, residual) in fit.equations.iter().zip(&mut drawn) {
            *residual -= &own.jacobian * &fitted;
        }
        let reference = self::statistics(fit, &cells, &loads, &drawn);
        let count = |reference: f64, observed: f64| f64::from(u8::from(reference >= observed));
        exceeded.whole += count(reference.whole, statistics.whole);
        exceeded.servo += count(reference.servo, statistics.servo);
        for (place, sum) in sums.iter_mut().enumerate() {
            exceeded.loads[place] += count(reference.loads[place], statistics.loads[place]);
            *sum += reference.loads[place];
        }
    }
    let part = |count: f64| count / (MISFIT_DRAWS + 1) as f64;
    Ok(RigMisfit {
        p_value: part(exceeded.whole),
        servo_p_value: part(exceeded.servo),
        loads: loads
            .iter()
            .enumerate()
            .map(|(place, (load, trials))| LoadResidual {
                load: *load,
                trials: trials.len(),
                ratio: libm::sqrt(statistics.loads[place] / (sums[place] / MISFIT_DRAWS as f64)),
                p_value: part(exceeded.loads[place]),
            })
            .collect(),
    })
}

fn statistics(
    fit: &RigFit,
    cells: &[Vec<usize>],
    loads: &[(RigLoad, Vec<usize>)],
    residuals: &[DVector<f64>],
) -> RigMisfitStatistics {
    let standardised: Vec<DVector<f64>> = fit
        .equations
        .iter()
        .zip(residuals)
        .map(|(own, residual)| (&own.factor * residual).component_div(&own.deviations))
        .collect();
    let sum = |trial: usize, of_servo: bool| -> f64 {
        let labels = &fit.equations[trial].labels;
        labels
            .iter()
            .zip(standardised[trial].iter())
            .filter(|(label, _)| (label.channel == MomentChannel::Servo) == of_servo)
            .map(|(_, value)| value * value)
            .sum()
    };
    let over_scatter = |of_servo: bool| {
        let total: f64 = (0..residuals.len()).map(|trial| sum(trial, of_servo)).sum();
        let channels: &[MomentChannel] =
            if of_servo { &[MomentChannel::Servo] } else { &[MomentChannel::Torque, MomentChannel::Mean] };
        let (mut within, mut freedom) = (0.0, 0.0);
        for channel in channels {
            let (sum, own) = scatter_within(cells, &fit.equations, &standardised, *channel);
            within += sum;
            freedom += own;
        }
        // Without repetitions the noise at rest alone says how large a residual may be.
        if freedom > 0.0 { (total - within) / (within / freedom) } else { total }
    };
    RigMisfitStatistics {
        whole: over_scatter(false),
        servo: over_scatter(true),
        loads: loads.iter().map(|(_, trials)| trials.iter().map(|trial| sum(*trial, false)).sum()).collect(),
    }
}

/// A matrix whose product with its transpose is a covariance.
pub fn square_root(covariance: &DMatrix<f64>) -> DMatrix<f64> {
    let eigen = covariance.clone().symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| libm::sqrt(value.max(0.0)));
    &eigen.eigenvectors * DMatrix::from_diagonal(&roots)
}
