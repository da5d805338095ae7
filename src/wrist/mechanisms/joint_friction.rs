//! A torque at the wrist that opposes motion and hardly depends on its speed.

use super::{MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct JointFriction;

impl Mechanism for JointFriction {
    const ID: &'static str = "joint_friction";
    const TITLE: &'static str = "Coulomb-like friction at the wrist";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("level_nm", "friction torque in motion", (0.0, 1.0), Some(0.0), 0.05),
        MechanismParameter::new("presliding_rad", "travel over which it builds up", (0.0002, 0.005), None, 0.0005),
    ];
    const SOURCE: &'static str = "Dahl 1968: dz/dt = (level w - z |w|) / presliding; the bristles' torque z tends to the level in motion";
    const MEMORY: usize = 1;

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _past: &History<T>,
        slot: usize,
        torques: &mut Torques<T>,
        rates: &mut [T; MEMORY],
    ) {
        let (speed, bristles) = (moment.state.omega_j, moment.state.memory[slot]);
        let (forward, backward) = (speed.positive_part(), (-speed).positive_part());
        rates[slot] = (forward * (p[0] - bristles) - backward * (p[0] + bristles)) / p[1];
        torques.joint = torques.joint + bristles;
    }
}
