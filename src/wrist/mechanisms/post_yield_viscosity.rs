//! Velocity-proportional torque beyond the elastic limit.

use super::{MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct PostYieldViscosity;

impl Mechanism for PostYieldViscosity {
    const ID: &'static str = "post_yield_viscosity";
    const TITLE: &'static str = "viscosity beyond the elastic limit";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("coefficient_nm_s_per_rad", "torque per speed beyond x_e", (0.0, 2.0), Some(0.0), 0.15),
    ];
    const SOURCE: &'static str = "Rack and Westbury 1974: beyond the short range the muscle acts like a viscous damper";

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _past: &History<T>,
        _slot: usize,
        torques: &mut Torques<T>,
        _rates: &mut [T; MEMORY],
    ) {
        torques.joint = torques.joint + p[0] * moment.state.omega_j * torques.beyond.logistic();
    }
}
