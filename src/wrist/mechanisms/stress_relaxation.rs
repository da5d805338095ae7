//! A Maxwell branch beside k_j: a spring whose torque fades.

use super::{ProbeContext, MechanismClass, Mechanism, MechanismParameter, History};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context, Torques};

/// See the module.
pub struct StressRelaxation;

impl Mechanism for StressRelaxation {
    const ID: &'static str = "stress_relaxation";
    const TITLE: &'static str = "stress relaxation in the muscle";
    const CLASS: MechanismClass = MechanismClass::Plant;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("stiffness_nm_per_rad", "stiffness of the Maxwell branch", (0.0, 100.0), Some(0.0), 15.0),
        MechanismParameter::new("time_constant_s", "its relaxation time", (0.001, 0.5), None, 0.01),
    ];
    const SOURCE: &'static str = "Maxwell element in parallel with k_j";
    const MEMORY: usize = 1;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.002, 0.006, 0.02].map(|time_constant| vec![15.0, time_constant]).to_vec()
    }

    #[inline(always)]
    fn act<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _past: &History<T>,
        slot: usize,
        torques: &mut Torques<T>,
        rates: &mut [T; MEMORY],
    ) {
        let branch = moment.state.memory[slot];
        rates[slot] = p[0] * moment.state.omega_j - branch / p[1];
        torques.joint = torques.joint + branch;
    }
}
