//! A lever whose inertia I_l is not the one that the session states.

use super::{Surroundings, Class, Covariates, Mechanism, Need, Parameter};
use crate::wrist::number::Number;
use crate::wrist::plant::Plant;

/// See the module.
pub struct LeverInertia;

impl Mechanism for LeverInertia {
    const ID: &'static str = "lever_inertia";
    const TITLE: &'static str = "the lever's inertia is not as assumed";
    const CLASS: Class = Class::Rig;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("inertia_kg_m2", "I_l", (1e-05, 0.05), None, 0.0016),
    ];
    const SOURCE: &'static str = "I_l of Table 1 of de Vlugt et al. 2011";
    const NEEDS: &'static [Need] = &[Need::Lever];

    fn probes(session: &Surroundings) -> Vec<Vec<f64>> {
        session.lever.map(|lever| vec![1.1 * lever.inertia_kg_m2]).into_iter().collect()
    }

    #[inline(always)]
    fn shape<T: Number>(p: &[T], plant: &mut Plant<T>, _trial: &Covariates<T::Plain>) {
        if let Some(lever) = &mut plant.lever {
            lever.inertia = p[0];
        }
    }
}
