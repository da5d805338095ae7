//! Torque from the delayed, rectified stretch velocity through a lag.

use super::{ProbeContext, MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct StretchReflex;

impl Mechanism for StretchReflex {
    const ID: &'static str = "stretch_reflex";
    const TITLE: &'static str = "a stretch reflex inside the window";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("gain_nm_s_per_rad", "torque per stretch velocity", (0.0, 20.0), Some(0.0), 0.3),
        MechanismParameter::new("latency_s", "delay between stretch and torque", (0.012, 0.2), None, 0.025),
        MechanismParameter::new("time_constant_s", "lag of the activation", (0.002, 0.1), None, 0.01),
    ];
    const SOURCE: &'static str = "Delayed, half-wave rectified stretch velocity through a first-order lag";
    const MEMORY: usize = 1;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        // Gain, latency and time constant: early and late, quick and slow.
        [(0.015, 0.005), (0.02, 0.01), (0.025, 0.005), (0.03, 0.01)].map(|(latency, lag)| vec![0.3, latency, lag]).to_vec()
    }

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        history: &History<T>,
        slot: usize,
        torques: &mut Torques<T>,
        rates: &mut [T; MEMORY],
    ) {
        let lagged = moment.state.memory[slot];
        rates[slot] = (moment.state.omega_j.positive_part() - lagged) / p[2];
        torques.joint = torques.joint + p[0] * history.read(slot, moment.time_s, p[1]);
    }
}
