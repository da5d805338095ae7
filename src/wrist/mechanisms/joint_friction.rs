//! A torque at the wrist that opposes motion and hardly depends on its speed.

use super::{Class, Mechanism, Parameter, Past};
use crate::wrist::number::Number;
use crate::wrist::plant::{MEMORY, Moment, Torques};

/// See the module.
pub struct JointFriction;

impl Mechanism for JointFriction {
    const ID: &'static str = "joint_friction";
    const TITLE: &'static str = "Coulomb-like friction at the wrist";
    const CLASS: Class = Class::Plant;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("level_nm", "friction torque in motion", (0.0, 1.0), Some(0.0), 0.05),
        Parameter::new("presliding_rad", "travel over which it builds up", (0.0002, 0.005), None, 0.0005),
    ];
    const SOURCE: &'static str = "Dahl 1968: dz/dt = (level w - z |w|) / presliding; the bristles' torque z tends to the level in motion";
    const MEMORY: usize = 1;

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Moment<'_, T>,
        _past: &Past<T>,
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
