//! What the catalogue declares of priors, of laws, and of what a mechanism does.

use super::*;
use crate::wrist::mechanisms::{ActiveMechanisms, MechanismParameter, Place, Prior, ProbeContext};
use crate::wrist::{AddedDynamics, Context, History, Plant, State, Torques};

const SESSION: ProbeContext = ProbeContext { lever: Some(LEVER), highest_torque_nm: 5.0, window_s: 0.04 };

fn priors() -> impl Iterator<Item = (MechanismKind, MechanismParameter, Prior)> {
    CATALOGUE.iter().flat_map(|kind| {
        kind.parameters()
            .iter()
            .enumerate()
            .map(|(index, parameter)| (*kind, *parameter, kind.prior(index, &SESSION)))
    })
}

#[test]
fn the_form_of_a_prior_is_that_of_the_bounds() {
    for (kind, MechanismParameter { name, low, high, absent, .. }, prior) in priors() {
        let fits = match prior {
            Prior::LogNormal { .. } => low > 0.0,
            // b_j of the base model is not quite zero.
            Prior::HalfNormal { .. } => absent.is_some_and(|absent| absent - low < 1e-4 * (high - low)),
            Prior::Normal { .. } => low <= 0.0,
        };
        assert!(fits, "{}.{name}: {prior:?} with bounds {low} to {high}", kind.id());
    }
}

#[test]
fn a_prior_has_most_of_its_mass_within_the_bounds() {
    for (kind, MechanismParameter { name, low, high, absent, .. }, prior) in priors() {
        let (from, to) = match prior {
            Prior::Normal { mean, sd } => (mean - sd, mean + sd),
            Prior::HalfNormal { sd } => (absent.unwrap(), absent.unwrap() + 2.0 * sd),
            Prior::LogNormal { median, log_sd } => (median * libm::exp(-log_sd), median * libm::exp(log_sd)),
        };
        assert!(low <= from && to <= high, "{}.{name}: {from} to {to}, bounds {low} to {high}", kind.id());
    }
}

#[test]
fn the_prior_of_a_lever_constant_is_about_the_value_stated() {
    let lever = Lever { inertia_kg_m2: 0.003, damping_nm_s_per_rad: 0.2, stiffness_nm_per_rad: 500.0 };
    let session = ProbeContext { lever: Some(lever), ..SESSION };
    let stated = [
        (MechanismKind::LeverInertia, 0.003),
        (MechanismKind::LeverDamping, 0.2),
        (MechanismKind::LeverStiffness, 500.0),
        (MechanismKind::TorqueSaturation, 5.0),
    ];
    for (kind, value) in stated {
        assert!(matches!(kind.prior(0, &session), Prior::LogNormal { median, .. } if median == value));
    }
}

#[test]
fn only_a_law_with_an_argument_has_a_spread() {
    for kind in CATALOGUE {
        let space = kind.law_space();
        assert_eq!(space.argument.is_some(), space.sd > 0.0, "{}: {space:?}", kind.id());
    }
}

/// Added states of a test.
const STATES: [f64; 8] = [0.3, -0.2, 0.5, 0.1, 0.4, -0.6, 0.2, 0.7];

/// What a mechanism adds to the torques of a wrist that moves, and the rates of its states.
fn added(kind: MechanismKind, history: &History<f64>) -> (Torques<f64>, [f64; 8]) {
    let (trial, parameters) = (ramp(2.6).covariates, with(kind));
    let plant = Plant::base(Some(LEVER), &PERSON);
    let state = State { theta_l: 0.09, omega_l: 2.0, theta_j: 0.081, omega_j: 1.7 };
    let handle = Kinematics { theta: state.theta_l, omega: state.omega_l };
    let mut torques = Torques { lever: 0.0, interface: 0.0, joint: 0.0, beyond: 0.4, measured: 0.0 };
    let mut rates = [0.0; 8];
    let active = ActiveMechanisms { kinds: &[kind], parameters: &parameters[6..], trial: &trial, history };
    let context = Context { plant: &plant, state: &state, handle, time_s: 0.04 };
    active.add_torques(&context, &STATES, &mut torques, &mut rates);
    (torques, rates)
}

/// A simulation leaves out what a mechanism does not declare.
#[test]
fn a_mechanism_adds_torques_where_it_declares_to_and_nowhere_else() {
    let mut history = History::new(-0.01, PERIOD_S, STATES.len());
    for sample in 0..200 {
        history.push(&STATES.map(|state| state * f64::from(sample)), &[1.0; 8]);
    }
    for kind in CATALOGUE.iter().chain(FREE_LAWS).copied() {
        let (torques, rates) = added(kind, &history);
        let on_handle = [torques.lever, torques.interface].iter().any(|torque| *torque != 0.0);
        let is_anywhere = on_handle || torques.joint != 0.0;
        if kind.adds_torque() {
            let is_free_or_moves = is_anywhere || kind.is_free_law();
            assert!(is_free_or_moves, "{} adds a torque", kind.id());
            assert!(!on_handle || kind.law_space().place != Place::Joint, "{} acts on the handle", kind.id());
        } else {
            assert!(!is_anywhere && rates == [0.0; 8], "{} adds no torque", kind.id());
        }
        if !kind.reads_past() {
            let without = added(kind, &History::new(0.0, PERIOD_S, STATES.len()));
            assert_eq!(format!("{:?}", (torques, rates)), format!("{without:?}"), "{}", kind.id());
        }
    }
}

#[test]
fn a_mechanism_that_declares_nothing_else_alters_the_yield_alone() {
    let history = History::new(0.0, PERIOD_S, 0);
    for kind in CATALOGUE.iter().chain(FREE_LAWS).copied() {
        // Off typical values, of which some are those of the plant.
        let parameters = with(kind).into_iter().map(|own| 1.3 * own).collect::<Vec<f64>>();
        let trial = ramp(2.6).covariates;
        let before = Plant::base(Some(LEVER), &PERSON);
        let mut plant = before;
        let active = ActiveMechanisms {
            kinds: &[kind],
            parameters: &parameters[6..],
            trial: &trial,
            history: &history,
        };
        active.alter_plant(&mut plant);
        let (stiffness_decrement, elastic_limit, smoothness) =
            (plant.stiffness_decrement, plant.elastic_limit, plant.smoothness);
        let of_yield_alone = Plant { stiffness_decrement, elastic_limit, smoothness, ..before };
        let alters_more = format!("{plant:?}") != format!("{of_yield_alone:?}");
        assert_eq!(alters_more, kind.alters_linear_part(), "{}", kind.id());
    }
}

#[test]
fn the_rates_of_states_in_the_torque_channel_are_linear() {
    let (trial, history) = (ramp(2.6).covariates, History::new(0.0, PERIOD_S, 0));
    for kind in CATALOGUE.iter().chain(FREE_LAWS).copied() {
        let count = kind.channel_state_count();
        let parameters = with(kind);
        let active = ActiveMechanisms {
            kinds: &[kind],
            parameters: &parameters[6..],
            trial: &trial,
            history: &history,
        };
        let rates = |states: [f64; 4], torque: f64| {
            let mut rates = [0.0; 4];
            active.alter_measurement(&states[..count], 0.01, torque, &mut rates);
            rates
        };
        if count == 0 {
            continue;
        }
        let (a, b) = (rates([0.3, -0.2, 0.5, 0.1], 0.7), rates([-0.1, 0.4, 0.2, 0.6], -0.4));
        let both = rates([0.7, -0.8, 0.8, -0.4], 1.8);
        for state in 0..count {
            let sum = 2.0 * a[state] - b[state];
            assert!((both[state] - sum).abs() < 1e-9 * sum.abs().max(1.0), "{}", kind.id());
        }
    }
}
