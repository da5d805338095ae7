//! Voluntary torque that starts to change about the onset.

use super::{Class, Mechanism, Parameter, Past, Surroundings};
use crate::wrist::number::Number;
use crate::wrist::plant::{MEMORY, Moment, Torques};

/// See the module.
pub struct TorqueDrift;

impl Mechanism for TorqueDrift {
    const ID: &'static str = "torque_drift";
    const TITLE: &'static str = "the voluntary torque is not steady at the onset";
    const CLASS: Class = Class::Trial;
    const PARAMETERS: &'static [Parameter] = &[
        Parameter::new("slope_nm_per_s", "slope of the torque", (-50.0, 50.0), Some(0.0), 1.0),
        Parameter::new("start_s", "when it starts, from the onset", (-Self::BEFORE_ONSET_S, 0.03), None, 0.005),
    ];
    const SOURCE: &'static str = "Linear change of the muscle's torque from a moment on";
    const BEFORE_ONSET_S: f64 = 0.02;

    fn probes(_session: &Surroundings) -> Vec<Vec<f64>> {
        [-0.005, 0.005, 0.02].map(|start| vec![1.0, start]).to_vec()
    }

    fn from_the_onset(p: &mut [f64]) {
        p[1] = p[1].max(0.0);
    }

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Moment<'_, T>,
        _past: &Past<T>,
        _slot: usize,
        torques: &mut Torques<T>,
        _rates: &mut [T; MEMORY],
    ) {
        torques.joint = torques.joint + p[0] * (T::constant(moment.time_s) - p[1]).positive_part();
    }
}
