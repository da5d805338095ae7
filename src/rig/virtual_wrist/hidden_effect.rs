//! The effect that `run --hide` hides in a virtual wrist: a mechanism of the catalogue, drawn with a seed.

use super::MechanismList;
use crate::random::Stream;
use crate::wrist::Lever;
use crate::wrist::mechanisms::{CATALOGUE, MechanismKind};

/// Draws the effect that `seed` hides in a wrist with this lever.
///
/// It is any mechanism of the catalogue that has a range for hiding ([`MechanismKind::hidden_range`]), with its first parameter
/// uniform in that range, of either sign where the bounds allow both, and the others at their typical values.
pub fn draw_hidden_effect(seed: u64, lever: Option<Lever>) -> MechanismList {
    draw_from(CATALOGUE, seed, lever)
}

/// The effect that a session of an earlier version hides, which kept nothing but a digest of the seed.
///
/// The catalogue was `CATALOGUE_OF_UNSEALED_EFFECTS` then. The effect is right as long as the ranges of these mechanisms stay.
pub(super) fn draw_unsealed_effect(seed: u64, lever: Option<Lever>) -> MechanismList {
    let catalogue: Vec<MechanismKind> = CATALOGUE_OF_UNSEALED_EFFECTS
        .iter()
        .map(|id| MechanismKind::from_id(id).expect("mechanisms of earlier versions stay in the catalogue"))
        .collect();
    draw_from(&catalogue, seed, lever)
}

/// The catalogue when sessions kept no sealed effect. Do not change it: the order decides what a seed draws.
const CATALOGUE_OF_UNSEALED_EFFECTS: [&str; 26] = [
    "joint_damping",
    "joint_friction",
    "interface_hardening",
    "interface_slack",
    "stretch_reflex",
    "stress_relaxation",
    "post_yield_viscosity",
    "gradual_yield",
    "stiffening",
    "timed_yield",
    "lever_inertia",
    "lever_stiffness",
    "lever_damping",
    "servo_following",
    "channel_skew",
    "torque_lag",
    "torque_gain",
    "angle_gain",
    "torque_saturation",
    "mains_hum",
    "torque_drift",
    "fatigue",
    "thixotropy",
    "cocontraction",
    "outlier_trial",
    "activation_scaling",
];

fn draw_from(catalogue: &[MechanismKind], seed: u64, lever: Option<Lever>) -> MechanismList {
    let mut stream = Stream::new(seed, "hidden effect");
    let candidates: Vec<(MechanismKind, (f64, f64))> =
        catalogue.iter().filter_map(|kind| Some((*kind, kind.hidden_range(lever)?))).collect();
    let (kind, (low, high)) = candidates[stream.below(candidates.len() as u64) as usize];
    let first = &kind.parameters()[0];
    let value = low + (high - low) * stream.uniform();
    let other_sign = first.absent.map(|absent| 2.0 * absent - value);
    let mirrored =
        other_sign.filter(|value| (first.low..=first.high).contains(value) && stream.uniform() < 0.5);
    let others = kind.parameters()[1..].iter().map(|parameter| parameter.typical);
    let values = std::iter::once(mirrored.unwrap_or(value)).chain(others).collect();
    [(kind, values)].into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVER: Lever =
        Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

    #[test]
    fn every_mechanism_with_a_range_is_drawn_with_values_that_a_fit_may_try() {
        let mut drawn: Vec<MechanismKind> = Vec::new();
        for seed in 0..400 {
            let effect = draw_hidden_effect(seed, Some(LEVER));
            assert_eq!(effect, draw_hidden_effect(seed, Some(LEVER)));
            for (parameter, value) in effect.kinds[0].parameters().iter().zip(&effect.parameters) {
                assert!((parameter.low..=parameter.high).contains(value), "{:?}: {value}", effect.kinds[0]);
                assert!(parameter.absent != Some(*value), "{:?} has no effect", effect.kinds[0]);
            }
            drawn.extend(&effect.kinds);
        }
        for kind in CATALOGUE {
            assert_eq!(drawn.contains(kind), kind.hidden_range(Some(LEVER)).is_some(), "{kind:?}");
        }
    }

    #[test]
    fn a_rigid_lever_hides_no_mechanism_that_needs_a_lever() {
        use crate::wrist::mechanisms::DataRequirement;
        let needs_lever =
            |seed| draw_hidden_effect(seed, None).kinds[0].needs().contains(&DataRequirement::Lever);
        assert!(!(0..300).any(needs_lever));
    }

    #[test]
    fn sessions_of_earlier_versions_draw_the_effect_that_they_drew() {
        // What the last version without sealed effects reveals, to four digits.
        for (seed, id, value) in
            [(7, "lever_stiffness", 638.5), (8, "lever_damping", 0.6191), (9, "lever_inertia", 0.003076)]
        {
            let effect = draw_unsealed_effect(seed, Some(LEVER));
            assert_eq!(effect.kinds[0].id(), id);
            assert!((effect.parameters[0] / value - 1.0).abs() < 2e-4, "{id}: {:?}", effect.parameters);
        }
    }
}
