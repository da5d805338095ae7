//! Hand-handle stiffness that grows with its deflection: k_h (1 + strength d^2).

use super::{MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct InterfaceHardening;

impl Mechanism for InterfaceHardening {
    const ID: &'static str = "interface_hardening";
    const TITLE: &'static str = "the hand-handle interface stiffens as it is deflected";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("strength_per_rad2", "relative growth of k_h with the square of the deflection", (0.0, 200000.0), Some(0.0), 2000.0),
    ];
    const SOURCE: &'static str = "Cubic spring; skin and foam stiffen under load";

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _past: &History<T>,
        _slot: usize,
        torques: &mut Torques<T>,
        _rates: &mut [T; MEMORY],
    ) {
        let deflection = moment.handle.theta - moment.state.theta_j;
        let growth = p[0] * deflection * deflection;
        torques.interface = torques.interface + moment.plant.interface_stiffness * deflection * growth;
    }
}
