//! What next: the protocol that best separates causes which a session could not tell apart.
//!
//! Each protocol in question is run on paper: the wrist as fitted with one cause, the motor moving as commanded, the noise of
//! the session. The other cause is fitted to it. What it leaves of the sum of squares, D, in units of the noise, is how far
//! the two are apart; in a real session the lead of the true cause is then normal about D with variance 4 D.

use std::slice;

use nalgebra::Vector3;
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::predicted_torque::torques;
use super::preprocessing::Look;
use crate::dataset::Session;
use crate::fit::{
    ExtensionSearch, Fit, K_SRS, Model, Observations, ParameterSpec, PreprocessingError,
    PreprocessingSettings, StartingValues, Weighting, objective,
};
use crate::protocol::{Protocol, Sweep, ValidProtocol};
use crate::statistics::WeightedRegression;
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{BASE_PARAMETERS, Kinematics, TrialInput};

/// A protocol that might be run next.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// What it changes, for a person.
    pub change: String,
    /// The protocol.
    pub protocol: ValidProtocol,
    /// For each pair of causes, the true one first: the probability that the other is ruled out.
    pub power: Vec<(MechanismKind, MechanismKind, f64)>,
}

impl Proposal {
    /// The smallest of its powers.
    pub fn least_power(&self) -> f64 {
        self.power.iter().map(|(_, _, power)| *power).fold(1.0, f64::min)
    }
}

/// Protocols for telling `causes` apart, the best first and of equals the shortest; `now` is the one that the session was run
/// by. Proposals that no check would pass are not made.
///
/// # Errors
/// As [`Observations::new`].
pub fn design(
    session: &Session,
    now: &ValidProtocol,
    causes: &[MechanismKind],
) -> Result<Vec<Proposal>, PreprocessingError> {
    let mut seen: Vec<Seen> = Vec::new();
    let mut proposals = Vec::new();
    for (change, protocol) in variants(now) {
        let place = match seen.iter().position(|own| own.window_s == protocol.window_s) {
            Some(place) => place,
            None => match Seen::new(session, &protocol, causes) {
                Ok(new) => {
                    seen.push(new);
                    seen.len() - 1
                }
                // The records are too short for a longer window.
                Err(_) if protocol.window_s > now.window_s => continue,
                Err(error) => return Err(error),
            },
        };
        let power = power(&seen[place], &protocol, causes);
        proposals.push(Proposal { change, protocol, power });
    }
    let trials = |proposal: &Proposal| proposal.protocol.trial_count();
    proposals.sort_by(|a, b| b.least_power().total_cmp(&a.least_power()).then(trials(a).cmp(&trials(b))));
    Ok(proposals)
}

/// The session as seen in one window, and fitted with each of the causes.
struct Seen {
    window_s: f64,
    prepared: Observations,
    fits: Vec<Fit>,
}

impl Seen {
    fn new(
        session: &Session,
        protocol: &ValidProtocol,
        causes: &[MechanismKind],
    ) -> Result<Self, PreprocessingError> {
        let view = PreprocessingSettings { window_s: protocol.window_s, filter: protocol.signal.filter };
        let prepared = Look::new(session, view, &Model::paper())?.prepared;
        let base = Fit::new(&prepared, &Model::paper(), Weighting::MeasuredNoise);
        let search = ExtensionSearch::new(&prepared, &base);
        let with = |kind: &MechanismKind| {
            let model = Model::paper().with(*kind);
            search.complete(&search.screen(slice::from_ref(&model))).refined(&prepared)
        };
        let fits = causes.par_iter().map(with).collect();
        Ok(Self { window_s: view.window_s, prepared, fits })
    }
}

/// The protocol as it is, and changed in what separates mechanisms: more trials, a wider range of velocity or torque, a longer
/// way and window, slower rises.
fn variants(now: &ValidProtocol) -> Vec<(String, ValidProtocol)> {
    let spread = |values: &[f64], low: f64, high: f64| {
        let last = values.len().max(2) as f64 - 1.0;
        let stretched = |(place, value): (usize, &f64)| {
            let factor = low + (high - low) * place as f64 / last;
            (value * factor * 1e3).round() / 1e3
        };
        values.iter().enumerate().map(stretched).collect::<Vec<f64>>()
    };
    let longest = now.velocities_rad_s.iter().fold(0.0_f64, |far, v| far.max(v.abs()));
    let mut longer: Protocol = (**now).clone();
    longer.window_s = 1.5 * now.window_s;
    let way = (1.1 * longest * longer.window_s * 1e3).ceil() / 1e3;
    longer.ramp.amplitude_rad = way.max(now.ramp.amplitude_rad);
    longer.limits.angle_rad[1] = longer.limits.angle_rad[1].max(1.2 * longer.ramp.amplitude_rad);
    let change = |change: &dyn Fn(&mut Protocol)| {
        let mut protocol: Protocol = (**now).clone();
        change(&mut protocol);
        protocol
    };
    let wide_velocities = spread(&now.velocities_rad_s, 0.5, 1.15);
    let wide_torques = spread(&now.torques_nm, 0.6, 1.5);
    let candidates = [
        ("as it was".to_string(), (**now).clone()),
        ("twice the repetitions".into(), change(&|own| own.repetitions *= 2)),
        (
            format!("velocities {wide_velocities:?} rad/s"),
            change(&|own| own.velocities_rad_s = wide_velocities.clone()),
        ),
        (format!("torques {wide_torques:?} N m"), change(&|own| own.torques_nm = wide_torques.clone())),
        (
            "both, wider".into(),
            change(&|own| {
                own.velocities_rad_s = wide_velocities.clone();
                own.torques_nm = wide_torques.clone();
            }),
        ),
        (format!("{} rad in a window of {} s", longer.ramp.amplitude_rad, longer.window_s), longer.clone()),
        (
            "longer, wider and twice the repetitions".into(),
            Protocol {
                velocities_rad_s: wide_velocities.clone(),
                torques_nm: wide_torques.clone(),
                repetitions: 2 * now.repetitions,
                ..longer
            },
        ),
        ("a rise of half the time".into(), change(&|own| own.ramp.rise_time_s *= 0.5)),
        ("a rise of twice the time".into(), change(&|own| own.ramp.rise_time_s *= 2.0)),
    ];
    let named = |(change, protocol): (String, Protocol)| {
        let name = format!("{}: {change}", now.name);
        Some((change, Protocol { name, ..protocol }.validate().ok()?))
    };
    candidates.into_iter().filter_map(named).collect()
}

/// For each ordered pair of causes, the probability that a session of `protocol` in which the first is true rules the second
/// out.
fn power(
    seen: &Seen,
    protocol: &ValidProtocol,
    causes: &[MechanismKind],
) -> Vec<(MechanismKind, MechanismKind, f64)> {
    let Seen { prepared, fits, .. } = seen;
    let pairs: Vec<(usize, usize)> = (0..causes.len())
        .flat_map(|one| (0..causes.len()).filter(move |other| *other != one).map(move |other| (one, other)))
        .collect();
    let distances: Vec<f64> = pairs
        .par_iter()
        .map(|(one, other)| distance(prepared, protocol, &fits[*one], &fits[*other]))
        .collect();
    let distance_of = |pair: (usize, usize)| {
        let place = pairs.iter().position(|own| *own == pair).unwrap_or(0);
        distances[place]
    };
    let powers = pairs.iter().map(|(one, other)| {
        let power = power_of(distance_of((*one, *other)), distance_of((*other, *one)));
        (causes[*one], causes[*other], power)
    });
    powers.collect()
}

/// The lead of the true cause is normal about `true_distance`; the other is ruled out if it would leave as much in less than
/// one session of twenty were it the true one, when the lead is normal about minus `other_distance`.
fn power_of(true_distance: f64, other_distance: f64) -> f64 {
    const ONE_IN_TWENTY: f64 = 1.645;
    let needed = (ONE_IN_TWENTY * 2.0 * libm::sqrt(other_distance) - other_distance).max(0.0);
    let spread = 2.0 * libm::sqrt(true_distance);
    if spread == 0.0 {
        return 0.0;
    }
    Normal::standard().cdf((true_distance - needed) / spread)
}

/// What is left of the sum of squares, in units of the noise, where `truth` is the case and the model of `other` is fitted.
fn distance(prepared: &Observations, protocol: &ValidProtocol, truth: &Fit, other: &Fit) -> f64 {
    let mut planned = planned(prepared, protocol);
    let parameters = at_conditions(&planned, prepared, truth);
    let predicted = torques(&planned, &truth.kinds, &parameters);
    for (trial, torque) in planned.trials.iter_mut().zip(predicted) {
        trial.measured_nm = torque;
    }
    let starts = at_conditions(&planned, prepared, other);
    let guess = StartingValues::at(&planned, &starts);
    let mut model = other.model.clone();
    let added = &other.parameters[0][BASE_PARAMETERS.len()..];
    let treatments = model.mechanisms.iter_mut().flat_map(|switched| &mut switched.parameters);
    for (treatment, value) in treatments.zip(added) {
        *treatment = ParameterSpec { value: Some(*value), ..treatment.clone() };
    }
    let (weights, covariances) = objective(&planned, Weighting::MeasuredNoise, Some(&guess.median_values()));
    2.0 * Fit::from_starting_values(&planned, &model, weights, covariances, &guess).cost()
}

/// The trials of `protocol`, moved as commanded, with the noise of the nearest torque of the session.
fn planned(prepared: &Observations, protocol: &ValidProtocol) -> Observations {
    let mut planned = prepared.subset(&[]);
    let margin = 2 * prepared.lead_samples;
    let before = prepared.lead_samples + margin;
    let mut condition = 0;
    for velocity in &protocol.velocities_rad_s {
        for torque in &protocol.torques_nm {
            let Ok(sweep) =
                Sweep::new(protocol.ramp.amplitude_rad, velocity.abs(), protocol.ramp.rise_time_s)
            else {
                continue;
            };
            let nearest = nearest(prepared, *torque);
            for repetition in 1..=protocol.repetitions {
                let knot = |sample: usize| {
                    let time = (sample as f64 - before as f64) * prepared.period_s;
                    let motion = sweep.at(time);
                    Kinematics { theta: motion.angle_rad, omega: motion.velocity_rad_s }
                };
                let mut trial = prepared.trials[nearest].clone();
                trial.input = TrialInput {
                    motion: (0..before + prepared.samples + margin).map(knot).collect(),
                    onset: before,
                    covariates: trial.input.covariates,
                };
                trial.input.covariates.velocity_rad_s = velocity.abs();
                trial.input.covariates.torque_before_nm = *torque;
                (trial.velocity_rad_s, trial.torque_nm) = (velocity.abs(), *torque);
                (trial.condition, trial.repetition) = (condition, repetition);
                planned.noise_index.push(prepared.noise_index[nearest]);
                planned.trials.push(trial);
            }
            condition += 1;
        }
    }
    planned
}

/// A trial of the session at the torque nearest to this.
fn nearest(prepared: &Observations, torque_nm: f64) -> usize {
    let away = |trial: &usize| (prepared.trials[*trial].torque_nm - torque_nm).abs();
    (0..prepared.trials.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0)
}

/// The parameters of `fit` at the conditions of other trials: k_srs, k_dec and x_e as powers of velocity and torque, the
/// others their means.
fn at_conditions(planned: &Observations, prepared: &Observations, fit: &Fit) -> Vec<Vec<f64>> {
    let design = |velocity: f64, torque: f64| {
        Vector3::new(1.0, libm::log(velocity.abs().max(1e-3)), libm::log(torque.abs().max(1e-3)))
    };
    let coefficients: Vec<Vector3<f64>> = (0..BASE_PARAMETERS.len())
        .map(|parameter| {
            let mut regression = WeightedRegression::new(RIDGE);
            for (trial, own) in prepared.trials.iter().zip(&fit.parameters) {
                let mut x = design(trial.velocity_rad_s, trial.torque_nm);
                if parameter < K_SRS {
                    (x[1], x[2]) = (0.0, 0.0);
                }
                regression.add(&x, 1.0, libm::log(own[parameter]));
            }
            regression.solve().unwrap_or_else(Vector3::zeros)
        })
        .collect();
    let own = |trial: &crate::fit::TrialObservation| {
        let x = design(trial.velocity_rad_s, trial.torque_nm);
        let base = coefficients.iter().map(|own| libm::exp(own.dot(&x)));
        base.chain(fit.parameters[0][BASE_PARAMETERS.len()..].iter().copied()).collect()
    };
    planned.trials.iter().map(own).collect()
}

/// Penalty on the squared coefficients, so that a factor that does not vary has coefficient zero.
const RIDGE: f64 = 1e-6;
