//! Voluntary torque that starts to change about the onset.

use super::{MechanismClass, Mechanism, MechanismParameter, History, ProbeContext};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct TorqueDrift;

impl Mechanism for TorqueDrift {
    const ID: &'static str = "torque_drift";
    const TITLE: &'static str = "the voluntary torque is not steady at the onset";
    const CLASS: MechanismClass = MechanismClass::Trial;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("slope_nm_per_s", "slope of the torque", (-50.0, 50.0), Some(0.0), 1.0),
        MechanismParameter::new("start_s", "when it starts, from the onset", (-Self::BEFORE_ONSET_S, 0.03), None, 0.005),
    ];
    const SOURCE: &'static str = "Linear change of the muscle's torque from a moment on";
    const BEFORE_ONSET_S: f64 = 0.02;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [-0.005, 0.005, 0.02].map(|start| vec![1.0, start]).to_vec()
    }

    fn from_the_onset(p: &mut [f64]) {
        p[1] = p[1].max(0.0);
    }

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _past: &History<T>,
        _slot: usize,
        torques: &mut Torques<T>,
        _rates: &mut [T; MEMORY],
    ) {
        torques.joint = torques.joint + p[0] * (T::constant(moment.time_s) - p[1]).positive_part();
    }
}
