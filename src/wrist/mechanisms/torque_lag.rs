//! A low-pass in the torque channel that the angle channel does not have.

use super::{ProbeContext, MechanismClass, Covariates, Mechanism, MechanismParameter};
use crate::wrist::Lever;
use crate::number::Number;
use crate::wrist::plant::{MEMORY, Context};

/// See the module.
pub struct TorqueLag;

impl Mechanism for TorqueLag {
    const ID: &'static str = "torque_lag";
    const TITLE: &'static str = "a low-pass in the torque channel alone";
    const CLASS: MechanismClass = MechanismClass::Sensor;
    const PARAMETERS: &'static [MechanismParameter] = &[
        MechanismParameter::new("cutoff_hz", "cut-off of the first-order low-pass", (10.0, 5000.0), None, 150.0),
    ];
    const SOURCE: &'static str = "First-order low-pass";
    const MEMORY: usize = 1;

    fn delay_s(p: &[f64]) -> Option<f64> {
        Some(1.0 / (std::f64::consts::TAU * p[0]))
    }

    fn hidden_sizes(lever: Option<Lever>) -> Option<(f64, f64)> {
        let _ = lever;
        Some((80.0, 160.0))
    }

    fn probes(_session: &ProbeContext) -> Vec<Vec<f64>> {
        [60.0, 200.0].map(|cutoff| vec![cutoff]).to_vec()
    }

    #[inline(always)]
    fn measure<T: Number>(
        p: &[T],
        moment: &Context<'_, T>,
        _trial: &Covariates<T::Plain>,
        slot: usize,
        torque: T,
        rates: &mut [T; MEMORY],
    ) -> T {
        let lagged = moment.state.memory[slot];
        rates[slot] = (torque - lagged) * p[0].scale(std::f64::consts::TAU);
        lagged
    }
}
