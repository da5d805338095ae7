//! A lever whose stiffness k_l is not the one that the session states.

use super::{Surroundings, Class, Covariates, Mechanism, Need, Parameter};
use crate::wrist::number::Number;
use crate::wrist::plant::Plant;

/// See the module.
pub struct LeverStiffness;

impl Mechanism for LeverStiffness {
    const ID: &'static str = "lever_stiffness";
    const TITLE: &'static str = "the lever's stiffness is not as assumed";
    const CLASS: Class = Class::Rig;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("stiffness_nm_per_rad", "k_l", (20.0, 100000.0), None, 900.0),
    ];
    const SOURCE: &'static str = "k_l of Table 1 of de Vlugt et al. 2011";
    const NEEDS: &'static [Need] = &[Need::Lever];

    fn probes(session: &Surroundings) -> Vec<Vec<f64>> {
        session.lever.map(|lever| vec![1.1 * lever.stiffness_nm_per_rad]).into_iter().collect()
    }

    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        if let Some(lever) = &mut plant.lever {
            lever.stiffness = p[0];
        }
    }
}
