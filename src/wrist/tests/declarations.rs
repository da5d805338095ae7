//! What the catalogue declares of priors and laws.

use super::*;
use crate::wrist::mechanisms::{MechanismParameter, Prior, ProbeContext};

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
