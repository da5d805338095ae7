//! What to do next: the protocol, the rig trials or the sensor that best separate causes which a session did not distinguish.
//!
//! What each candidate measures is predicted with one cause, as fitted to the session, for the commanded motion and the noise of the
//! session. The other cause is then fitted to it. The remaining whitened sum of squares D is the distance between the two. In a real
//! session the logarithm of the evidence for the true cause, against the other, is normal with mean D / 2 and variance D; a cause is named
//! where it has a probability of 0.95, so where that logarithm is at least log 19. Rig trials add to D what they tell of the constants that
//! the causes are about.

use std::{fmt, slice};

use nalgebra::{DMatrix, Vector3};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::evidence::answer::NAMED_PROBABILITY;
use super::evidence::rig_knowledge::expected_distance;
use super::predicted_torque::torques;
use super::preprocessing::DiagnosisInput;
use crate::dataset::Session;
use crate::fit::{
    Fit, K_SRS, MechanismSearch, Model, Objective, Observations, ParameterSpec, PreprocessingError,
    PreprocessingSettings, StartingValues, Weighting,
};
use crate::protocol::{Protocol, Sweep, ValidProtocol};
use crate::signal::NoiseCovariance;
use crate::statistics::WeightedRegression;
use crate::wrist::mechanisms::MechanismKind;
use crate::wrist::{BASE_PARAMETERS, FurtherChannel, Kinematics, ScaledChannel, TrialInput};

/// What a proposal needs, the cheapest first.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Needs {
    /// A session with the subject.
    Session,
    /// Rig trials, without a person.
    RigTrials,
    /// A sensor, and a session with the subject.
    Sensor,
}

/// What is done otherwise than in the session.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ProposedChange {
    /// Nothing: another session with the same protocol.
    Nothing,
    /// This, in words.
    Described(String),
}

impl fmt::Display for ProposedChange {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Nothing => "unchanged",
            Self::Described(words) => words,
        })
    }
}

/// A candidate for what to do next.
#[derive(Debug, Clone)]
pub struct Proposal {
    /// What to do otherwise than in the session.
    pub change: ProposedChange,
    /// What it needs.
    pub needs: Needs,
    /// The protocol of the session to run.
    pub protocol: ValidProtocol,
    /// For each ordered pair of causes (true, other): the probability that the true one is named, if these two are left.
    pub power: Vec<(MechanismKind, MechanismKind, f64)>,
}

impl Proposal {
    /// The smallest power over the pairs of causes.
    pub fn least_power(&self) -> f64 {
        self.power.iter().map(|(_, _, power)| *power).fold(1.0, f64::min)
    }

    /// Whether this is the session's protocol as it is.
    pub fn is_unchanged(&self) -> bool {
        self.change == ProposedChange::Nothing
    }
}

/// A variant is worth offering if it raises the smallest power by this much over that of the session's protocol.
const WORTHWHILE_POWER: f64 = 0.05;

/// Two causes count as separable if a proposal is more likely than not to name the true one, whichever it is.
const SEPARATING_POWER: f64 = 0.5;

/// Logarithm of the odds from which on a cause is named.
fn named_log_odds() -> f64 {
    libm::log(NAMED_PROBABILITY / (1.0 - NAMED_PROBABILITY))
}

/// Sensors that can be added, with the standard deviation of their noise, in the unit of the channel. Assumed: encoders of 17 bits, whose
/// rounding is taken as noise, and what docs/how-to/more-sensors.md has of the others.
const SENSORS: [(FurtherChannel, f64); 4] = [
    (FurtherChannel::HandleAcceleration, 3.0),
    (FurtherChannel::HandleAngle, 1.4e-5),
    (FurtherChannel::HandTorque, 0.01),
    (FurtherChannel::JointAngle, 1.4e-5),
];

/// The proposals that are expected to gain something over the protocol as it is, and that protocol itself, in the order given.
pub fn worthwhile(proposals: Vec<Proposal>) -> Vec<Proposal> {
    let now = proposals.iter().find(|own| own.is_unchanged()).map_or(0.0, Proposal::least_power);
    let gains = |own: &Proposal| own.least_power() >= now + WORTHWHILE_POWER;
    proposals.into_iter().filter(|own| own.is_unchanged() || gains(own)).collect()
}

/// Pairs of causes that none of the proposals separates, with the largest power that any of them has.
pub fn inseparable(proposals: &[Proposal]) -> Vec<(MechanismKind, MechanismKind, f64)> {
    let Some(first) = proposals.first() else { return Vec::new() };
    let pairs = first.power.iter().filter(|(one, other, _)| one.id() < other.id());
    let best = |(one, other, _): &(MechanismKind, MechanismKind, f64)| {
        let of = |proposal: &Proposal| {
            let own = proposal
                .power
                .iter()
                .filter(|(a, b, _)| (a == one && b == other) || (a == other && b == one));
            own.map(|(_, _, power)| *power).fold(1.0, f64::min)
        };
        (*one, *other, proposals.iter().map(of).fold(0.0, f64::max))
    };
    pairs.map(best).filter(|(_, _, power)| *power < SEPARATING_POWER).collect()
}

/// What separates `causes`: protocols, rig trials and sensors, the cheapest first. `now` is the protocol of the session. Protocols that are
/// not valid are left out, and so is what the session has already.
///
/// # Errors
/// As [`Observations::new`].
pub fn propose(
    session: &Session,
    now: &ValidProtocol,
    causes: &[MechanismKind],
) -> Result<Vec<Proposal>, PreprocessingError> {
    let mut seen: Vec<CausesInWindow> = Vec::new();
    let mut proposals = Vec::new();
    let mut unchanged = Vec::new();
    for (change, protocol) in variants(now) {
        let place = match seen.iter().position(|own| own.window_s == protocol.window_s) {
            Some(place) => place,
            None => match CausesInWindow::new(session, &protocol, causes) {
                Ok(new) => {
                    seen.push(new);
                    seen.len() - 1
                }
                // The records may be too short for a longer window.
                Err(_) if protocol.window_s > now.window_s => continue,
                Err(error) => return Err(error),
            },
        };
        let distances = seen[place].distances(&protocol, None);
        let power = seen[place].power(&distances, |_| 0.0);
        if change == ProposedChange::Nothing {
            unchanged = distances;
        }
        proposals.push(Proposal { change, needs: Needs::Session, protocol, power });
    }
    if let Some(own) = seen.iter().find(|own| own.window_s == now.window_s) {
        let told = own.told_by_rig_trials();
        if told.iter().any(Option::is_some) {
            proposals.push(Proposal {
                change: ProposedChange::Described(
                    "rig trials with all loads, and `ramphold calibrate`".into(),
                ),
                needs: Needs::RigTrials,
                protocol: now.clone(),
                power: own.power(&unchanged, |cause| told[cause].unwrap_or(0.0)),
            });
        }
        let has = |channel| own.observations.further.iter().any(|further| further.channel == channel);
        for sensor in SENSORS.iter().filter(|(channel, _)| !has(*channel)) {
            let power = own.power(&own.distances(now, Some(*sensor)), |_| 0.0);
            let words = format!("a sensor of the {} ({})", sensor.0.title(), sensor.0.column());
            let change = ProposedChange::Described(words);
            proposals.push(Proposal { change, needs: Needs::Sensor, protocol: now.clone(), power });
        }
    }
    let minutes = |proposal: &Proposal| proposal.protocol.duration().expected_s;
    proposals.sort_by(|a, b| {
        let cost = a.needs.cmp(&b.needs).then(minutes(a).total_cmp(&minutes(b)));
        cost.then(b.least_power().total_cmp(&a.least_power()))
    });
    Ok(proposals)
}

/// The session analysed in one window and fitted with each of the causes.
struct CausesInWindow {
    causes: Vec<MechanismKind>,
    window_s: f64,
    observations: Observations,
    fits: Vec<Fit>,
}

impl CausesInWindow {
    fn new(
        session: &Session,
        protocol: &ValidProtocol,
        causes: &[MechanismKind],
    ) -> Result<Self, PreprocessingError> {
        let view = PreprocessingSettings::of(protocol);
        let observations = DiagnosisInput::new(session, view, &Model::paper())?.observations;
        let base = Fit::new(&observations, &Model::paper(), Weighting::MeasuredNoise);
        let search = MechanismSearch::new(&observations, &base);
        let with = |kind: &MechanismKind| {
            let model = Model::paper().with(*kind);
            search.complete(&search.screen(slice::from_ref(&model))).refined(&observations)
        };
        let fits = causes.par_iter().map(with).collect();
        Ok(Self { causes: causes.to_vec(), window_s: view.window_s, observations, fits })
    }
}

/// The present protocol and its variants: more trials, wider ranges of velocity or torque, a longer ramp and window, other rise times.
fn variants(now: &ValidProtocol) -> Vec<(ProposedChange, ValidProtocol)> {
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
        ("twice the repetitions".to_owned(), change(&|own| own.repetitions *= 2)),
        (
            format!("velocities {wide_velocities:?} rad/s"),
            change(&|own| own.velocities_rad_s = wide_velocities.clone()),
        ),
        (format!("torques {wide_torques:?} N m"), change(&|own| own.torques_nm = wide_torques.clone())),
        (
            "wider velocities and torques".into(),
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
        ("half the rise time".into(), change(&|own| own.ramp.rise_time_s *= 0.5)),
        ("twice the rise time".into(), change(&|own| own.ramp.rise_time_s *= 2.0)),
    ];
    let changed = candidates.map(|(words, protocol)| (ProposedChange::Described(words), protocol));
    let named = |(change, protocol): (ProposedChange, Protocol)| {
        let name = format!("{}: {change}", now.name);
        Some((change, Protocol { name, ..protocol }.validate().ok()?))
    };
    [(ProposedChange::Nothing, (**now).clone())].into_iter().chain(changed).filter_map(named).collect()
}

/// Two causes by their places, and how far the second is from the first if that is true.
type PairDistance = (usize, usize, f64);

impl CausesInWindow {
    /// For each ordered pair of causes, the distance in a session with `protocol`, and with a further sensor.
    fn distances(
        &self,
        protocol: &ValidProtocol,
        sensor: Option<(FurtherChannel, f64)>,
    ) -> Vec<PairDistance> {
        let count = self.causes.len();
        let others =
            |one: usize| (0..count).filter(move |other| *other != one).map(move |other| (one, other));
        let pairs: Vec<(usize, usize)> = (0..count).flat_map(others).collect();
        let planned = planned(&self.observations, protocol, sensor);
        let of_pair = |(one, other): &(usize, usize)| {
            let own = distance(&planned, &self.observations, &self.fits[*one], &self.fits[*other]);
            (*one, *other, own)
        };
        pairs.par_iter().map(of_pair).collect()
    }

    /// For each ordered pair of causes, the probability that the first is named if it is true, where `added` tells of each cause how far
    /// from any other it is besides.
    fn power(
        &self,
        distances: &[PairDistance],
        added: impl Fn(usize) -> f64,
    ) -> Vec<(MechanismKind, MechanismKind, f64)> {
        let of_pair = |(one, other, own): &PairDistance| {
            let probability = probability_of_name(own + added(*one) + added(*other));
            (self.causes[*one], self.causes[*other], probability)
        };
        distances.iter().map(of_pair).collect()
    }

    /// How far from any other rig trials are expected to place each cause, as it is fitted; `None` where they do not tell.
    fn told_by_rig_trials(&self) -> Vec<Option<f64>> {
        let causes = self.causes.iter().zip(&self.fits);
        let told = |(cause, fit): (&MechanismKind, &Fit)| {
            expected_distance(*cause, *fit.parameters[0].get(BASE_PARAMETERS.len())?, self.observations.lever)
        };
        causes.map(told).collect()
    }
}

/// Probability that the true cause is named at this distance from the other.
fn probability_of_name(distance: f64) -> f64 {
    if distance <= 0.0 {
        return 0.0;
    }
    Normal::standard().cdf((0.5 * distance - named_log_odds()) / libm::sqrt(distance))
}

/// Whitened sum of squares that remains when the model of `other` is fitted to the torque predicted by `truth`.
fn distance(planned: &Observations, observations: &Observations, truth: &Fit, other: &Fit) -> f64 {
    let mut planned = planned.clone();
    let parameters = at_conditions(&planned, observations, truth);
    let predicted = torques(&planned, &truth.kinds, &parameters);
    for (trial, torque) in planned.trials.iter_mut().zip(predicted) {
        trial.measured_nm = torque;
    }
    let starts = at_conditions(&planned, observations, other);
    let guess = StartingValues::from_parameters(&planned, &starts);
    let mut model = other.model.clone();
    let added = &other.parameters[0][BASE_PARAMETERS.len()..];
    let treatments = model.mechanisms.iter_mut().flat_map(|switched| &mut switched.parameters);
    for (treatment, value) in treatments.zip(added) {
        *treatment = ParameterSpec { value: Some(*value), ..treatment.clone() };
    }
    let (weights, covariances) =
        Objective::new(&planned, Weighting::MeasuredNoise, Some(&guess.median_values()));
    2.0 * Fit::from_starting_values(&planned, &model, weights, covariances, &guess).cost()
}

/// The trials of `protocol` with the commanded motion and the noise of the nearest torque of the session, and a further sensor.
fn planned(
    observations: &Observations,
    protocol: &ValidProtocol,
    sensor: Option<(FurtherChannel, f64)>,
) -> Observations {
    let mut planned = observations.subset(&[]);
    if let Some((channel, noise)) = sensor {
        add_sensor(&mut planned, channel, noise);
    }
    let margin = 2 * observations.lead_samples;
    let before = observations.lead_samples + margin;
    let mut condition = 0;
    for velocity in &protocol.velocities_rad_s {
        for torque in &protocol.torques_nm {
            let Ok(sweep) =
                Sweep::new(protocol.ramp.amplitude_rad, velocity.abs(), protocol.ramp.rise_time_s)
            else {
                continue;
            };
            let nearest = nearest(observations, *torque);
            for repetition in 1..=protocol.repetitions {
                let knot = |sample: usize| {
                    let time = (sample as f64 - before as f64) * observations.period_s;
                    let motion = sweep.at(time);
                    Kinematics { theta: motion.angle_rad, omega: motion.velocity_rad_s }
                };
                let mut trial = observations.trials[nearest].clone();
                trial.input = TrialInput {
                    motion: (0..before + observations.samples + margin).map(knot).collect(),
                    onset: before,
                    covariates: trial.input.covariates,
                };
                trial.input.covariates.velocity_rad_s = velocity.abs();
                trial.input.covariates.torque_before_nm = *torque;
                (trial.velocity_rad_s, trial.torque_nm) = (velocity.abs(), *torque);
                (trial.condition, trial.repetition) = (condition, repetition);
                planned.noise_index.push(observations.noise_index[nearest]);
                planned.trials.push(trial);
            }
            condition += 1;
        }
    }
    planned
}

/// Adds a sensor whose noise, `sd` in its unit, is white and independent of the torque's.
fn add_sensor(planned: &mut Observations, channel: FurtherChannel, sd: f64) {
    let torque_nm = |noise: &NoiseCovariance| {
        libm::sqrt(noise.covariance.diagonal().iter().sum::<f64>() / noise.covariance.nrows() as f64)
    };
    let sds: Vec<f64> = planned.noise_covariances.iter().map(torque_nm).collect();
    // In N m, its noise is as large as that of the torque.
    let sd_nm = sds.iter().sum::<f64>() / sds.len().max(1) as f64;
    planned.further.push(ScaledChannel { channel, nm_per_unit: sd_nm / sd });
    planned.further_step.push(0.0);
    let added = planned.window_noise_samples().count();
    for noise in &mut planned.noise_covariances {
        let before = noise.covariance.nrows();
        let mut covariance = DMatrix::from_diagonal_element(before + added, before + added, sd_nm * sd_nm);
        covariance.view_mut((0, 0), (before, before)).copy_from(&noise.covariance);
        noise.covariance = covariance;
    }
}

/// Index of a trial of the session at the torque nearest to `torque_nm`.
fn nearest(observations: &Observations, torque_nm: f64) -> usize {
    let away = |trial: &usize| (observations.trials[*trial].torque_nm - torque_nm).abs();
    (0..observations.trials.len()).min_by(|a, b| away(a).total_cmp(&away(b))).unwrap_or(0)
}

/// Parameters of `fit` at the conditions of the planned trials: power laws of velocity and torque for k_srs, k_dec and x_e, geometric
/// means for the others.
fn at_conditions(planned: &Observations, observations: &Observations, fit: &Fit) -> Vec<Vec<f64>> {
    let design = |velocity: f64, torque: f64| {
        Vector3::new(1.0, libm::log(velocity.abs().max(1e-3)), libm::log(torque.abs().max(1e-3)))
    };
    let coefficients: Vec<Vector3<f64>> = (0..BASE_PARAMETERS.len())
        .map(|parameter| {
            let mut regression = WeightedRegression::new(RIDGE);
            for (trial, own) in observations.trials.iter().zip(&fit.parameters) {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wrist::mechanisms::CATALOGUE;

    fn described(words: &str) -> ProposedChange {
        ProposedChange::Described(words.to_owned())
    }

    fn proposal(change: ProposedChange, [one, other]: [f64; 2]) -> Proposal {
        let protocol =
            ValidProtocol::parse(include_str!("../../protocols/quick.json"), "quick.json").unwrap();
        let (a, b) = (CATALOGUE[0], CATALOGUE[1]);
        let power = vec![(a, b, one), (b, a, other)];
        Proposal { change, needs: Needs::Session, protocol, power }
    }

    #[test]
    fn what_gains_nothing_is_not_offered() {
        let all = vec![
            proposal(described("twice"), [0.9, 0.8]),
            proposal(ProposedChange::Nothing, [0.5, 0.6]),
            proposal(described("half"), [0.52, 0.9]),
            // Words do not make it the protocol as it is.
            proposal(described("unchanged"), [0.1, 0.1]),
        ];
        let offered: Vec<ProposedChange> = worthwhile(all).into_iter().map(|own| own.change).collect();
        assert_eq!(offered, [described("twice"), ProposedChange::Nothing]);
    }

    #[test]
    fn a_cause_is_named_half_of_the_time_where_the_expected_lead_is_what_a_name_needs() {
        assert_eq!(probability_of_name(0.0), 0.0);
        assert!((probability_of_name(2.0 * named_log_odds()) - 0.5).abs() < 1e-9);
        assert!((named_log_odds() - libm::log(19.0)).abs() < 1e-12);
        assert!(probability_of_name(100.0) > 0.999_9);
    }

    #[test]
    fn a_pair_that_no_protocol_separates_is_named() {
        assert!(
            inseparable(&[
                proposal(ProposedChange::Nothing, [0.1, 0.9]),
                proposal(described("twice"), [0.7, 0.6])
            ])
            .is_empty()
        );
        let [(_, _, power)] = inseparable(&[
            proposal(ProposedChange::Nothing, [0.1, 0.9]),
            proposal(described("twice"), [0.3, 1.0]),
        ])[..] else {
            panic!("one pair")
        };
        assert_eq!(power, 0.3);
    }
}
