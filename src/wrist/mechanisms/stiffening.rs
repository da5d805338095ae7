//! Stiffness that grows with the joint angle: k_srs (1 + c theta_j).

use super::{MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct Stiffening;

impl Mechanism for Stiffening {
    const ID: &'static str = "stiffening";
    const TITLE: &'static str = "stiffness grows with the joint angle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("coefficient_per_rad", "relative growth of k_srs with the joint angle", (-10.0, 30.0), Some(0.0), 4.0),
    ];
    const SOURCE: &'static str = "First-order dependence of stiffness on angle";

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _past: &History<T>,
        _slot: usize,
        torques: &mut Torques<T>,
        _rates: &mut [T; MEMORY],
    ) {
        let angle = moment.state.theta_j;
        torques.joint = torques.joint + moment.plant.short_range_stiffness * p[0] * angle * angle.scale(0.5);
    }
}
