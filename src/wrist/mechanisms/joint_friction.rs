//! A torque at the wrist that opposes motion and hardly depends on its speed.

use super::{Class, Mechanism, Parameter, Past};
use crate::wrist::number::Number;
use crate::wrist::plant::{MEMORY, Moment, Torques};

/// Speed over which friction builds up, rad/s.
const SMOOTHING_RAD_S: f64 = 0.05;

/// See the module.
pub struct JointFriction;

impl Mechanism for JointFriction {
    const ID: &'static str = "joint_friction";
    const TITLE: &'static str = "Coulomb-like friction at the wrist";
    const CLASS: Class = Class::Plant;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("level_nm", "friction torque in motion", (0.0, 1.0), Some(0.0), 0.05),
    ];
    const SOURCE: &'static str = "Coulomb friction, smoothed by tanh over 0.05 rad/s";

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Moment<'_, T>,
        _past: &Past<T>,
        _slot: usize,
        torques: &mut Torques<T>,
        _rates: &mut [T; MEMORY],
    ) {
        torques.joint = torques.joint + p[0] * moment.state.omega_j.scale(1.0 / SMOOTHING_RAD_S).tanh();
    }
}
