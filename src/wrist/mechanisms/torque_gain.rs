//! A calibration error of the torque.

use super::{MechanismClass, Covariates, Mechanism, MechanismParameter, ProbeContext};
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context};

/// See the module.
pub struct TorqueGain;

impl Mechanism for TorqueGain {
    const ID: &'static str = "torque_gain";
    const TITLE: &'static str = "the torque is recorded too large or too small";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("factor", "recorded over true torque", (0.3, 3.0), Some(1.0), 1.05),
    ];
    const SOURCE: &'static str = "Calibration factor";
    const EXACT: bool = true;

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [0.87, 1.15].map(|factor| vec![factor]).to_vec()
    }

    #[inline(always)]
    fn measure<T: Number>(
        p: &[T],
        _moment: &Context<'_, T>,
        _trial: &Covariates<T::Plain>,
        _slot: usize,
        torque: T,
        _rates: &mut [T; MEMORY],
    ) -> T {
        torque * p[0]
    }
}
