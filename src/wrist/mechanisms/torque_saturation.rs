//! A torque channel that clips at a level.

use super::{ProbeContext, MechanismClass, Covariates, Mechanism, MechanismParameter};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context};

/// See the module.
pub struct TorqueSaturation;

impl Mechanism for TorqueSaturation {
    const ID: &'static str = "torque_saturation";
    const TITLE: &'static str = "the torque channel clips";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("level_nm", "largest torque the channel shows", (0.5, 100.0), None, 5.0),
    ];
    const SOURCE: &'static str = "Clipping of the measured torque";

    fn probes(session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.8, 0.95].map(|part| vec![part * session.highest_torque_nm]).to_vec()
    }

    #[inline(always)]
    fn measure<T: Number>(
        p: &[T],
        _moment: &Context<'_, T>,
        trial: &Covariates<T::Plain>,
        _slot: usize,
        torque: T,
        _rates: &mut [T; MEMORY],
    ) -> T {
        // The level is that of the torque itself; the model's torque is a change from the steady state.
        let room = p[0] - T::lift(trial.torque_before_nm);
        torque - (torque - room).positive_part()
    }
}
