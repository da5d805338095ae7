//! A lever whose stiffness k_l is not the one that the session states.

use super::{ProbeContext, MechanismClass, Covariates, Mechanism, DataRequirement, MechanismParameter};
use crate::wrist::Lever;
use crate::number::Number;
use crate::wrist::plant::Plant;

/// See the module.
pub struct LeverStiffness;

impl Mechanism for LeverStiffness {
    const ID: &'static str = "lever_stiffness";
    const TITLE: &'static str = "the lever's stiffness is not as assumed";
    const CLASS: MechanismClass = MechanismClass::Rig;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("stiffness_nm_per_rad", "k_l", (20.0, 100000.0), None, 900.0),
    ];
    const SOURCE: &'static str = "k_l of Table 1 of de Vlugt et al. 2011";
    const NEEDS: &'static [DataRequirement] = &[DataRequirement::Lever];
    const EXACT: bool = true;

    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        lever.map(|lever| (0.6 * lever.stiffness_nm_per_rad, 0.75 * lever.stiffness_nm_per_rad))
    }

    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        let factors = |lever: Lever| [0.75, 1.3].map(|factor| vec![factor * lever.stiffness_nm_per_rad]);
        session.lever.into_iter().flat_map(factors).collect()
    }

    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        if let Some(lever) = &mut plant.lever {
            lever.stiffness = p[0];
        }
    }
}
