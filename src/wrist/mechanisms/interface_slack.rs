//! A dead zone between hand and handle: k_h acts only beyond it.

use super::{MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct InterfaceSlack;

impl Mechanism for InterfaceSlack {
    const ID: &'static str = "interface_slack";
    const TITLE: &'static str = "a dead zone between hand and handle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("half_width_rad", "half-width of the dead zone", (0.0, 0.02), Some(0.0), 0.0005),
    ];
    const SOURCE: &'static str = "Dead zone in series with k_h";

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
        // What the dead zone takes from the spring: the deflection itself inside, half a width beyond.
        let (above, below) = ((deflection - p[0]).positive_part(), (-deflection - p[0]).positive_part());
        torques.interface = torques.interface - moment.plant.interface_stiffness * (deflection - above + below);
    }
}
