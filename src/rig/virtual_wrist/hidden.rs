//! A game that trains and tests: an effect of the catalogue, drawn by a seed, at work in a virtual wrist whose files do not say
//! which.

use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};

use super::MechanismList;
use crate::random::Stream;
use crate::wrist::Lever;
use crate::wrist::mechanisms::{CATALOGUE, MechanismKind};

/// What a session's `rig.json` keeps of a hidden effect: enough to tell the right seed from a wrong one, and no more.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sealed {
    seal_sha256: String,
}

impl Sealed {
    /// The seal of `seed`.
    pub fn of(seed: u64) -> Self {
        let digest = Sha256::digest(format!("ramphold hides {seed}"));
        Self { seal_sha256: digest.iter().map(|byte| format!("{byte:02x}")).collect() }
    }
}

/// The effect that `seed` hides in a wrist with this lever: any of the catalogue that can be switched on and does something
/// there, two to four times its typical size, of either sign where it has one.
pub fn hidden(seed: u64, lever: Option<Lever>) -> MechanismList {
    let mut stream = Stream::new(seed, "hidden effect");
    let can: Vec<(MechanismKind, (f64, f64))> =
        CATALOGUE.iter().filter_map(|kind| Some((*kind, kind.hidden_range(lever)?))).collect();
    let (kind, (least, most)) = can[stream.below(can.len() as u64) as usize];
    let first = &kind.parameters()[0];
    let size = least + (most - least) * stream.uniform();
    let other_sign = first.absent.map(|absent| 2.0 * absent - size);
    let mirrored =
        other_sign.filter(|value| (first.low..=first.high).contains(value) && stream.uniform() < 0.5);
    let others = kind.parameters()[1..].iter().map(|parameter| parameter.typical);
    let values = std::iter::once(mirrored.unwrap_or(size)).chain(others).collect();
    [(kind, values)].into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVER: Lever =
        Lever { inertia_kg_m2: 0.0016, damping_nm_s_per_rad: 0.4, stiffness_nm_per_rad: 900.0 };

    #[test]
    fn seeds_hide_most_of_the_catalogue_and_every_value_is_one_that_a_fit_may_try() {
        let mut kinds: Vec<MechanismKind> = Vec::new();
        for seed in 0..400 {
            let drawn = hidden(seed, Some(LEVER));
            assert_eq!(drawn, hidden(seed, Some(LEVER)));
            for (parameter, value) in drawn.kinds[0].parameters().iter().zip(&drawn.parameters) {
                assert!((parameter.low..=parameter.high).contains(value), "{:?}: {value}", drawn.kinds[0]);
                assert!(parameter.absent != Some(*value), "{:?} has no effect", drawn.kinds[0]);
            }
            kinds.extend(&drawn.kinds);
        }
        kinds.sort();
        kinds.dedup();
        let cannot = [
            MechanismKind::TimedYield,
            MechanismKind::TorqueSaturation,
            MechanismKind::OutlierTrial,
            MechanismKind::Thixotropy,
        ];
        let missing: Vec<&MechanismKind> =
            CATALOGUE.iter().filter(|kind| !kinds.contains(kind) && !cannot.contains(kind)).collect();
        assert!(missing.is_empty(), "{missing:?} were never drawn");
    }

    #[test]
    fn a_rigid_lever_hides_nothing_of_the_lever() {
        let of_lever =
            [MechanismKind::LeverInertia, MechanismKind::LeverStiffness, MechanismKind::LeverDamping];
        assert!((0..300).all(|seed| !of_lever.contains(&hidden(seed, None).kinds[0])));
    }

    #[test]
    fn a_seal_fits_one_seed() {
        assert_eq!(Sealed::of(5), Sealed::of(5));
        assert_ne!(Sealed::of(5), Sealed::of(6));
    }
}
