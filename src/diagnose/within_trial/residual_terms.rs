//! Sparse regression of the remaining residuals on terms in angle, velocity, time and torque. The result is a description, not a
//! mechanism.

use nalgebra::{DMatrix, DVector};

use crate::diagnose::predicted_torque::residuals;
use crate::fit::{Fit, Observations};

/// A sparse description of the residual torque.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct ResidualDescription {
    /// Note for readers of the file.
    pub note: &'static str,
    /// The terms and their coefficients; their sum approximates the residual, N m.
    pub terms: Vec<DescriptionTerm>,
    /// Fraction of the residual's variance that the terms describe.
    pub described: f64,
    /// Time of the largest mean residual, s after the onset.
    pub largest_at_s: f64,
    /// Condition with the largest residual: velocity, rad/s, and torque, N m.
    pub largest_in: (f64, f64),
}

/// A term of the description.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct DescriptionTerm {
    /// Formula, such as `theta * omega`.
    pub term: String,
    /// Coefficient, N m per unit of the term.
    pub coefficient: f64,
}

/// Largest number of terms.
const MAX_TERMS: usize = 3;

/// Smallest fraction of the remaining variance that a further term must describe.
const MIN_DESCRIBED_FRACTION: f64 = 0.03;

/// Describes the residuals of `fit`; `None` if they are zero.
pub fn residual_term(observations: &Observations, fit: &Fit) -> Option<ResidualDescription> {
    let residuals: Vec<Vec<f64>> =
        residuals(observations, fit).into_iter().map(|own| observations.torque_of(&own).to_vec()).collect();
    let samples = observations.samples;
    let total = residuals.len() * samples;
    let own = DVector::from_iterator(total, residuals.iter().flatten().copied());
    let variance = own.norm_squared();
    if variance <= 0.0 {
        return None;
    }
    let dictionary = dictionary(observations);
    let mut chosen: Vec<usize> = Vec::new();
    let mut left = own.clone();
    let mut coefficients = DVector::zeros(0);
    while chosen.len() < MAX_TERMS {
        let score = |index: &usize| {
            let column = &dictionary[*index].1;
            column.dot(&left).powi(2) / column.norm_squared().max(1e-300)
        };
        let best = (0..dictionary.len())
            .filter(|i| !chosen.contains(i))
            .max_by(|a, b| score(a).total_cmp(&score(b)))?;
        if score(&best) < MIN_DESCRIBED_FRACTION * left.norm_squared() {
            break;
        }
        chosen.push(best);
        let columns: Vec<DVector<f64>> = chosen.iter().map(|i| dictionary[*i].1.clone()).collect();
        let design = DMatrix::from_columns(&columns);
        coefficients = design.clone().svd(true, true).solve(&own, 1e-12).ok()?;
        left = &own - &design * &coefficients;
    }
    let mean_at = |sample: usize| residuals.iter().map(|trial| trial[sample]).sum::<f64>().abs();
    let largest_at = (0..samples).max_by(|a, b| mean_at(*a).total_cmp(&mean_at(*b)))?;
    let square = |trial: &usize| residuals[*trial].iter().map(|e| e * e).sum::<f64>();
    let worst = (0..residuals.len()).max_by(|a, b| square(a).total_cmp(&square(b)))?;
    Some(ResidualDescription {
        note: "a description of what is left, not a mechanism",
        terms: chosen
            .iter()
            .zip(coefficients.iter())
            .map(|(index, coefficient)| DescriptionTerm {
                term: dictionary[*index].0.clone(),
                coefficient: *coefficient,
            })
            .collect(),
        described: 1.0 - left.norm_squared() / variance,
        largest_at_s: largest_at as f64 * observations.period_s,
        largest_in: (observations.trials[worst].velocity_rad_s, observations.trials[worst].torque_nm),
    })
}

/// The candidate terms, evaluated at all samples of all trials.
fn dictionary(observations: &Observations) -> Vec<(String, DVector<f64>)> {
    let window = observations.samples as f64 * observations.period_s;
    type Basis = (String, Box<dyn Fn(f64, f64, f64, f64) -> f64>);
    let mut basis: Vec<Basis> = vec![
        ("theta".into(), Box::new(|theta, _, _, _| theta)),
        ("omega".into(), Box::new(|_, omega, _, _| omega)),
        ("theta^2".into(), Box::new(|theta, _, _, _| theta * theta)),
        ("omega^2".into(), Box::new(|_, omega, _, _| omega * omega)),
        ("theta * omega".into(), Box::new(|theta, omega, _, _| theta * omega)),
        ("theta^3".into(), Box::new(|theta, _, _, _| theta * theta * theta)),
        ("torque * theta".into(), Box::new(|theta, _, _, torque| torque * theta)),
        ("torque * omega".into(), Box::new(|_, omega, _, torque| torque * omega)),
        ("time".into(), Box::new(|_, _, time, _| time)),
        ("torque * time".into(), Box::new(|_, _, time, torque| torque * time)),
    ];
    for place in 0..8 {
        let (centre, width) = ((place as f64 + 0.5) / 8.0 * window, window / 12.0);
        let bump = move |time: f64| libm::exp(-0.5 * ((time - centre) / width).powi(2));
        let at = format!("bump at {:.1} ms", centre * 1e3);
        basis.push((at.clone(), Box::new(move |_, _, time, _| bump(time))));
        basis.push((format!("velocity * {at}"), Box::new(move |_, omega, time, _| omega * bump(time))));
    }
    basis
        .into_iter()
        .map(|(name, value)| {
            let column = observations.trials.iter().flat_map(|trial| {
                let knots = &trial.input.motion[trial.input.onset..trial.input.onset + observations.samples];
                let value = &value;
                knots.iter().enumerate().map(move |(sample, knot)| {
                    value(knot.theta, knot.omega, sample as f64 * observations.period_s, trial.torque_nm)
                })
            });
            let column: Vec<f64> = column.collect();
            (name, DVector::from_vec(column))
        })
        .collect()
}
